"""Parts of the receiver and detector processes.

They record raw captures and channels, search for unlisted senders, detect hanging searches and
measure the latency.
"""
