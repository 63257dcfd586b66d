"""One vehicle as the ground station represents and commands it.

`served_vehicle` joins `ground_connection`, `drone_reports` and `current_flight`; `feed` sends
changes to the pages. `protocol` and `delivery_receipts` implement the protocol without I/O;
`drone_link` runs it over MAVLink and `parallel_links` over several links at once.
`command_sender` sends one command at a time, and `vehicle_state` receives the autopilot's
frames. `vehicle_identity` and `keys` authenticate the other side. `my_place` reads this
computer's own GPS receiver. `motion_requests` and `page_motions` request motions;
`path_assignments` keeps drones that search together apart.
"""
