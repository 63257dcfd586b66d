"""Search recordings again, and measure tags in them.

`redetect` searches a flight's recording again. `measure_tag` measures a nearby tag's frequency,
interval and pulse width. `switched` measures recordings made with an antenna switch.
`waterfall` makes spectrograms, and `channel_files` splits a band into channels.
"""
