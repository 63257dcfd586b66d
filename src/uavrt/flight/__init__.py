"""Write and read flight directories without losing data, even from damaged ones.

`flight_recorder` writes a flight and `reading/flight_reader` reads it; `flight_layout` names
its files, and `database/schema` its database's tables. `logs/pulse_logs` and
`logs/pulse_pose_log` write the thesis's text logs, and `database/spool` finds pulses that have
not reached the ground. `samples/iq_recorder` and `samples/channel_recorder` record samples.
"""
