"""One vehicle as the ground station represents and commands it; receipts for its pulses.

`served_vehicle` joins the parts. `delivery_receipts` acknowledges stored pulses, `protocol` is
the protocol without I/O, `drone_link` runs it over MAVLink, `command_sender` sends commands.
"""
