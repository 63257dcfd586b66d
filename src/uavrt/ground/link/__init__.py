"""Represent one vehicle on the ground station: state, commands, receipts for its pulses.

`served_vehicle` joins the parts. `delivery_receipts` acknowledges stored pulses, `protocol`
implements the protocol without I/O, `drone_link` runs it over MAVLink, and `command_sender`
sends commands.
"""
