"""Find one tag by all pulses of a whole flight, each too weak to be detected; no I/O.

`energies/energy_grid` turns a channel's samples into energies, `energies/folding` sums them for
every interval and phase, `flight_judgement` weights the sums by position and estimates their
chance in noise. `together` combines several flights. `tag_places` holds the tag's possible
positions, `heard_train` the slots of its pulses, `train_place` its position, `ground_cells` the
credible regions.
"""
