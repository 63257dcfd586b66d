"""Autopilot logs and receiver tracks, each read into one record (`track`).

`dataflash` reads ArduPilot's logs, `ulog` PX4's, `gps_tracks` GPX and NMEA.
"""
