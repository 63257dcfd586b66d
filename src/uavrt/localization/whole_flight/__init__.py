"""Find one tag by combining all pulses of a whole flight, each of which is too weak to be
detected; the package does no I/O.

`energies/energy_grid` converts a channel's samples to energies. `energies/folding` sums them
for every interval and phase. `flight_judgement` weights the sums by position and computes their
probability in noise. `together` combines several flights. `tag_places` contains the tag's
possible positions, `heard_train` the time slots of its pulses, `train_place` its position, and
`ground_cells` the credible regions.
"""
