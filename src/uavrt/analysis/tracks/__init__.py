"""Poses from autopilot logs and receiver tracks, for pulses without a pose.

`recognised` reads a track of any kind, most by `uavrt.formats.tracks`; `tlog` reads MAVLink
messages, `foreign_flight` and `simulated` tracks of uavrt. `attach` finds the clocks' offset
and gives each pulse its pose.
"""
