"""Files of other programs, to and from plain records; their limits are in core.

`pulses` are pulse logs of other systems, `tracks` autopilot logs and receiver tracks; `nmea`
and `gpsd` read receivers, `bearings_csv` and `positions_csv` tables of results. Readers that
need a room above stay there: recordings in the radio room, terrain in localization.
"""
