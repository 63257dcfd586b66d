"""Read and write files of other programs; every reader returns plain records.

`pulses` reads pulse logs of other systems. `tracks` reads autopilot logs and receiver tracks.
`nmea` and `gpsd` read messages of GPS receivers. `bearings_csv` and `positions_csv` read and
write tables of results. Recordings are read in `uavrt.radio` and terrain in
`uavrt.localization`, because their readers need those packages. Limits on file sizes are in
`uavrt.core.foreign`.
"""
