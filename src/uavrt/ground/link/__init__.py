"""The ground's side of the link to a drone.

`protocol` and `delivery_receipts` hold the protocol, without I/O; `drone_link` runs it over
MAVLink and `parallel_links` over several links at once. `commands` sends one command at a time,
`vehicle` listens to the autopilot, `vehicle_identity` and `keys` decide whom to trust;
`my_place` is this computer's own GPS receiver, `motion` and `flying` ask for motions,
`given_ways` keeps drones that search together apart.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ground.link.clock_skew import ClockSkew
    from uavrt.ground.link.commands import Commands, place_in
    from uavrt.ground.link.delivery_receipts import Receipts
    from uavrt.ground.link.drone_link import GroundLink
    from uavrt.ground.link.flying import Flying, area_of_file, number_in, places_in
    from uavrt.ground.link.given_ways import GivenWays
    from uavrt.ground.link.keys import NO_KEYS, LinkKeys, read_link_keys
    from uavrt.ground.link.motion import ask, confirm, motion_request, stop
    from uavrt.ground.link.my_place import MyPlace
    from uavrt.ground.link.parallel_links import Links, Ways
    from uavrt.ground.link.protocol import (
        Acknowledged,
        DetectorAlive,
        DroneHeartbeat,
        GroundEvent,
    )
    from uavrt.ground.link.stored_pulses import open_receipts
    from uavrt.ground.link.vehicle import VehicleWatch
    from uavrt.ground.link.vehicle_identity import VehicleIdentity

__all__ = [
    "NO_KEYS",
    "Acknowledged",
    "ClockSkew",
    "Commands",
    "DetectorAlive",
    "DroneHeartbeat",
    "Flying",
    "GivenWays",
    "GroundEvent",
    "GroundLink",
    "LinkKeys",
    "Links",
    "MyPlace",
    "Receipts",
    "VehicleIdentity",
    "VehicleWatch",
    "Ways",
    "area_of_file",
    "ask",
    "confirm",
    "motion_request",
    "number_in",
    "open_receipts",
    "place_in",
    "places_in",
    "read_link_keys",
    "stop",
]
__getattr__ = lazily(
    __name__,
    {
        "Acknowledged": "protocol",
        "ClockSkew": "clock_skew",
        "Commands": "commands",
        "DetectorAlive": "protocol",
        "DroneHeartbeat": "protocol",
        "Flying": "flying",
        "GivenWays": "given_ways",
        "GroundEvent": "protocol",
        "GroundLink": "drone_link",
        "LinkKeys": "keys",
        "MyPlace": "my_place",
        "NO_KEYS": "keys",
        "Receipts": "delivery_receipts",
        "VehicleIdentity": "vehicle_identity",
        "VehicleWatch": "vehicle",
        "Links": "parallel_links",
        "Ways": "parallel_links",
        "area_of_file": "flying",
        "number_in": "flying",
        "places_in": "flying",
        "ask": "motion",
        "confirm": "motion",
        "motion_request": "motion",
        "open_receipts": "stored_pulses",
        "place_in": "commands",
        "read_link_keys": "keys",
        "stop": "motion",
    },
)
