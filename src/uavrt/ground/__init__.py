"""The ground station.

`session` is all that one vehicle is to it, `fleet` several vehicles on the same links,
`station` one without a page. `link` talks to drones, `fetch` brings their files, `store` keeps
flights and settings, `web` serves the page.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ground.station import Station, StationSettings, json_line

__all__ = [
    "Station",
    "StationSettings",
    "json_line",
]
__getattr__ = lazily(
    __name__,
    {
        "Station": "station",
        "StationSettings": "station",
        "json_line": "station",
    },
)
