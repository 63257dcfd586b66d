"""Parts of the connection that send motion commands and report the vehicle's state.

`motion_orders` receives orders, `motion_control` accepts or refuses them.
"""
