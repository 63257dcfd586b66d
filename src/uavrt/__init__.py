"""Find radio-tagged animals from a drone: from radio samples to positions on a map."""

__version__ = "0.1.0"
