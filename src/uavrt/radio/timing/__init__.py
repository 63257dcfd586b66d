"""Determine times of a live stream's samples, and find and count lost samples.

`losses` infers losses from arrivals, `sample_times` gives each sample its time. Reported and
inferred losses are counted in `sample_placing`; `arrival_rate` checks the sample rate.
"""
