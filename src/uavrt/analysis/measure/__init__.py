"""Search recordings and measure tags after the flight.

`redetect` searches recordings again, `channel_files` holds their channels, `measure_tag`
measures frequency, interval and pulse width of a tag at hand, `switched` measures recordings
made with an antenna switch, `waterfall` shows a recording.
"""
