"""One tag judged over a whole flight: found below the noise of any group of pulses; no I/O.

`energy_grid` turns a channel's samples into energies, `folding` adds them up for every
interval and phase, `whole_flight` weighs the sums by place and says how likely chance is;
`together` adds up several flights; `places` holds where a tag might be, `heard_train` what the
slots of its pulses say, `train_place` where it is, `cells` how surely.
"""
