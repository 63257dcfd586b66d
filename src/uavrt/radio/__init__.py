"""Read radio samples from radio programs, pipes and files behind one interface.

`source` defines the interface and `opening` selects a source. `receivers` runs the programs of
radios, and `files` reads recordings. `timing` determines the times of samples and counts lost
samples. `sanity` rejects data that cannot come from a radio.
"""
