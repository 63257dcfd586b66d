"""The bars of bearings and positions, with intervals and bounds."""
