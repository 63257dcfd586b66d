"""Permission to command the vehicle: what may be sent, and what ends an order (`authority`).

`order_watch` decides which report shows a takeover. It uses `commanded` for the target,
`rc_watch` for sticks and switches, and `observed_vehicle` for failsafes and other states that
forbid an order. `offers` holds proposed orders.
"""
