"""Store flights and settings on the ground station.

`flight_keeper` and `flight_writer` record a flight, `stored_flights` reads them, and
`known_flights` caches their list. `estimates` computes bearings and positions;
`ground_settings` keeps settings between runs.
"""
