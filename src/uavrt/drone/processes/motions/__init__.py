"""Parts of the connection process that send motion commands and report the vehicle's state.

`motion_orders` receives the orders, and `motion_control` carries them out or refuses them.
"""
