"""The flight directory: written so that nothing is lost, readable even when damaged.

`flight_recorder` writes it and `flight_reader` reads it, `layout` names its files, `schema` the
tables of its database; `pulse_logs` and `pulse_pose_log` are the thesis's text logs, `spool`
what has not reached the ground. `iq_recorder` and `channel_recorder` keep samples.
"""
