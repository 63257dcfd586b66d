"""Who commands the vehicle, and what ends an order, as a pilot does (`authority`).

`authority` ends it. `order_watch` decides which report is a takeover: `commanded` judges the
target, `rc_watch` sticks and switches; `observed_vehicle` knows failsafes, `offers` proposals.
"""
