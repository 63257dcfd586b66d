"""Read poses from autopilot logs and receiver tracks, for pulses without a pose.

`recognised` reads a track of any kind: `dataflash`, `ulog`, `tlog`, `points` (GPX, NMEA),
`simulated`. `attach` estimates the clocks' offset and gives each pulse its pose.
"""
