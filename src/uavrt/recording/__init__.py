"""The flight directory: written so that nothing is lost, readable even when damaged.

`uavrt.recording.iq_recorder` needs NumPy and is not loaded here.
"""
