"""Ground storage: the flight being recorded, finished flights, settings.

`flight_keeper` starts and ends the ground's own flight, and `flight_writer` writes it to disk.
`stored_flights` lists and reads stored flights, and `known_flights` caches that list.
`estimates` computes bearings and positions. `ground_settings` keeps settings between runs.
"""
