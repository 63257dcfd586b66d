"""Run radios: their programs, drivers, devices and error messages."""
