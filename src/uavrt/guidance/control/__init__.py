"""Command of the vehicle: what may be sent, and what ends an order (`authority`).

`order_watch` decides which report is a takeover: `commanded` checks the target, `rc_watch`
sticks and switches, `observed_vehicle` failsafes and other states that forbid an order;
`offers` holds proposals.
"""
