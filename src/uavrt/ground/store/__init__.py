"""Store flights and settings on the ground station.

`flight_keeper` starts and ends the ground's recording of a flight, and `flight_writer` writes
it to disk. `stored_flights` lists and reads stored flights, and `known_flights` caches the
list. `estimates` computes bearings and positions. `ground_settings` keeps settings between
runs.
"""
