"""Ground storage: the flight being recorded, finished flights, settings.

`flight_keeper` starts and ends the ground's own flight, `flight_writer` writes it in the disk
thread, `flights` lists and reads stored flights, `known_flights` keeps what the list says,
`estimates` computes bearings and positions, `settings` persists between runs.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ground.store.beside_drone import flight_under_way, is_the_drones
    from uavrt.ground.store.estimates import AntennaChoice, Estimates, Estimator
    from uavrt.ground.store.event_log import EventLog
    from uavrt.ground.store.flight_keeper import FlightKeeper
    from uavrt.ground.store.flights import PULSE_COLUMNS, Columns, FlightLibrary
    from uavrt.ground.store.known_flights import FlightChoice
    from uavrt.ground.store.settings import GroundStore
    from uavrt.ground.store.stored import PULSES_NAME, PulseLines, read_ground_pulses

__all__ = [
    "PULSES_NAME",
    "PULSE_COLUMNS",
    "AntennaChoice",
    "Columns",
    "Estimates",
    "Estimator",
    "EventLog",
    "FlightChoice",
    "FlightKeeper",
    "FlightLibrary",
    "GroundStore",
    "PulseLines",
    "flight_under_way",
    "is_the_drones",
    "read_ground_pulses",
]
__getattr__ = lazily(
    __name__,
    {
        "AntennaChoice": "estimates",
        "Columns": "flights",
        "Estimates": "estimates",
        "Estimator": "estimates",
        "EventLog": "event_log",
        "FlightChoice": "known_flights",
        "FlightKeeper": "flight_keeper",
        "FlightLibrary": "flights",
        "GroundStore": "settings",
        "PULSES_NAME": "stored",
        "PulseLines": "stored",
        "PULSE_COLUMNS": "flights",
        "flight_under_way": "beside_drone",
        "is_the_drones": "beside_drone",
        "read_ground_pulses": "stored",
    },
)
