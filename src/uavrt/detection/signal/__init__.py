"""Order the samples of a channel, clean them, and measure pulses in them.

`block_order` sorts blocks, `sample_buffer` stores recent ones, `signal_cleaning` and
`carrier_lines` remove impulses and carriers, `whitening` and `sparks` level the noise, and
`occupancy` measures how often a frequency is usable.
"""
