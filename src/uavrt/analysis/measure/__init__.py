"""Search recordings again, and measure tags in them.

`redetect` searches a flight's recording again. `measure_tag` measures frequency, interval and
pulse width of a tag near the receiver. `switched` analyses recordings made with an antenna
switch. `waterfall` computes spectrograms, and `channel_files` splits a band into channels.
"""
