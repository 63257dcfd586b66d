"""The flight directory: written so that nothing is lost, readable even when damaged.

The recorder of samples, `uavrt.recording.iq_recorder`, needs NumPy and is not loaded here.
"""
