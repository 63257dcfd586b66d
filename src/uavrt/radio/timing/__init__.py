"""Determine the times of a live stream's samples, and find and count lost samples.

`losses` finds losses from arrival times. `sample_times` gives each sample its time.
`sample_placing` counts the losses that the radio reports and those that arrival times show.
`arrival_rate` checks the sample rate.
"""
