"""Order the samples of a channel, clean them, and measure pulses in them.

`block_order` sorts blocks, `sample_buffer` stores the recent ones and their gaps.
`signal_cleaning` and `carrier_lines` remove impulses and carriers; `whitening` makes the noise
white, and `sparks` makes it steady. `occupancy` measures the share of time in which a frequency
is usable.
"""
