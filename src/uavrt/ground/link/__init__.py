"""One vehicle as the ground station represents and commands it.

`served_vehicle` joins `connection`, `drone_reports` and `current_flight`; `feed` sends changes
to the pages. `protocol` and `delivery_receipts` implement the protocol without I/O;
`drone_link` runs it over MAVLink and `parallel_links` over several links at once. `commands`
sends one command at a time, and `vehicle` receives the autopilot's frames. `vehicle_identity`
and `keys` authenticate the other side. `my_place` reads this computer's own GPS receiver.
`motion` and `flying` request motions; `path_assignments` keeps
drones that search together apart.
"""
