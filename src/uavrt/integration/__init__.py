"""One tag judged over a whole flight: found below the noise of any group of pulses; no I/O.

`energy_grid` turns a channel's samples into energies, `folding` adds them up for every interval
and phase, `whole_flight` weights the sums by place and estimates their chance in noise;
`together` adds up several flights; `places` holds where a tag might be, `heard_train` the slots
of its pulses, `train_place` where it is, `cells` how surely.
"""
