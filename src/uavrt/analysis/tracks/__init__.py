"""Read poses from autopilot logs and tracks of GPS receivers, for pulses that have no pose.

`recognised` reads a track of any kind, most of them by `uavrt.formats.tracks`. `tlog` reads
telemetry logs of ground stations, and `simulated` the poses of a simulated vehicle.
`foreign_flight` converts a track to a flight record. `attach` determines the offset between the
clocks and gives each pulse its pose.
"""
