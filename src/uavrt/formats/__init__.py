"""Read and write files of other programs; every reader returns plain records.

`pulses` reads pulse logs, `tracks` logs and tracks with poses, `nmea` and `gpsd` GPS receivers;
`bearings_csv` and `positions_csv` are tables of results. Recordings are in `uavrt.radio`,
terrain in `uavrt.localization`, limits on file sizes in `uavrt.core.foreign`.
"""
