"""Operate radios: their programs, drivers, USB devices and error messages."""
