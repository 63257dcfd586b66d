"""Download flights from the drone to this computer.

`ftp_client` speaks MAVLink FTP, `drone_files` finds the quickest way to the drone,
`downloads` fetches for the page and shows progress, and `same_flight` protects local files.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ground.fetch.downloads import Downloads
    from uavrt.ground.fetch.drone_files import DroneFiles
    from uavrt.ground.fetch.flight_list import drone_flights
    from uavrt.ground.fetch.ftp_client import (
        MOST_DEEP,
        MOST_ENTRIES,
        FileClient,
        RemoteEntry,
        fetch_file,
        require_room,
    )
    from uavrt.ground.fetch.sample_files import BAND, CHANNELS, is_samples, sample_part

__all__ = [
    "BAND",
    "CHANNELS",
    "MOST_DEEP",
    "MOST_ENTRIES",
    "Downloads",
    "DroneFiles",
    "FileClient",
    "RemoteEntry",
    "drone_flights",
    "fetch_file",
    "is_samples",
    "require_room",
    "sample_part",
]
__getattr__ = lazily(
    __name__,
    {
        "BAND": "sample_files",
        "CHANNELS": "sample_files",
        "Downloads": "downloads",
        "DroneFiles": "drone_files",
        "FileClient": "ftp_client",
        "MOST_DEEP": "ftp_client",
        "MOST_ENTRIES": "ftp_client",
        "RemoteEntry": "ftp_client",
        "drone_flights": "flight_list",
        "fetch_file": "ftp_client",
        "is_samples": "sample_files",
        "require_room": "ftp_client",
        "sample_part": "sample_files",
    },
)
