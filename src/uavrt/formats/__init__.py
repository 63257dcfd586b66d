"""Read and write files of other programs, as plain records; limits on their size are in core.

`pulses` are pulse logs of other systems, `tracks` autopilot logs and receiver tracks; `nmea`
and `gpsd` read receivers, `bearings_csv` and `positions_csv` tables of results. Readers that
need another package of uavrt are in that package: recordings in radio, terrain in localization.
"""
