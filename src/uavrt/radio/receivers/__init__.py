"""Radios: their programs, drivers, devices and error messages."""
