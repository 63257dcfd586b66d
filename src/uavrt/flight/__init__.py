"""Write and read flight directories without losing data, even from damaged ones.

`flight_recorder` writes a flight and `reading/flight_reader` reads it. `flight_layout` defines
the names of its files, and `database/schema` the tables of its database. `logs/pulse_logs` and
`logs/pulse_pose_log` write text logs in the format of the original thesis. `database/spool`
finds pulses that no ground station has received. `samples/iq_recorder` and
`samples/channel_recorder` record samples.
"""
