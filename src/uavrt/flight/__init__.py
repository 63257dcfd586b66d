"""Write and read flight directories so that nothing is lost, even when they are damaged.

`flight_recorder` writes a flight and `flight_reader` reads it; `flight_layout` names its files,
and `schema` its database's tables. `pulse_logs` and `pulse_pose_log` are the thesis's text
logs, and `spool` finds pulses that have not reached the ground. `iq_recorder` and
`channel_recorder` record samples.
"""
