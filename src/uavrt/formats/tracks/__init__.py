"""Read autopilot logs and receiver tracks; each reader returns a `VehicleTrack`.

`dataflash` reads ArduPilot's logs, `ulog` reads PX4's logs, and `gps_tracks` reads GPX and
NMEA.
"""
