"""Read poses from autopilot logs and tracks of GPS receivers, for pulses that have no pose.

`recognised` reads a track of any kind, most of them by `uavrt.formats.tracks`; `tlog` reads
MAVLink messages, and `foreign_flight` and `simulated` read tracks for uavrt's own use. `attach`
determines the offset between the clocks and gives each pulse its pose.
"""
