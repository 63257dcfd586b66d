"""The thesis's §5.3: comparison of the drone's pulse log with the ground's."""
