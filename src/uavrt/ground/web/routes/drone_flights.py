"""Routes to list and download the drone's flights, and to show waterfalls."""

import asyncio
from dataclasses import asdict
from typing import Any

from starlette.requests import Request

from uavrt.core.errors import FormatError, NotFound
from uavrt.ground.session import GroundSession
from uavrt.ground.web.routes.routing import Row, json_object
from uavrt.ground.web.work.waterfalls import LiveWaterfall, recorded_picture, recordings, tag_of


class ExtraApi:
    """Flights on the drone, and waterfalls of recorded and live samples."""

    def __init__(self, session: GroundSession) -> None:
        self._session = session
        self._live = LiveWaterfall(
            lambda record: session.vehicle.feed.send("waterfall", record)
        )

    def routes(self) -> list[Row]:
        """List the routes for flights on the drone and for waterfalls."""
        return [
            Row("/drone/flights", "POST", self.drone_flights, commands=True),
            Row("/drone/download", "GET", self.download),
            Row("/drone/download", "POST", self.start_download, commands=True),
            Row("/drone/download", "DELETE", self.stop_download, commands=True),
            Row("/flights/{flight_id}/recordings", "GET", self.recordings),
            Row("/flights/{flight_id}/waterfall", "GET", self.waterfall),
            Row("/waterfall", "POST", self.live_waterfall, commands=True),
        ]

    async def drone_flights(self, request: Request) -> Any:
        """List the flights on the drone, requested over the radio."""
        return await self._session.downloads.flights()

    async def download(self, request: Request) -> Any:
        """Return the progress of the last download of a flight."""
        return self._session.downloads.record()

    async def start_download(self, request: Request) -> Any:
        """Start to download a flight: ``{"flight_id": …, "everything": false}``."""
        wanted = await json_object(request)
        everything = wanted.get("everything") is True
        started = self._session.downloads.start(
            str(wanted.get("flight_id", "")), everything=everything
        )
        return asdict(started)

    async def stop_download(self, request: Request) -> Any:
        """Stop the download in progress."""
        await self._session.downloads.stop()
        return self._session.downloads.record()

    async def recordings(self, request: Request) -> Any:
        """List the sample recordings of a flight on this computer."""
        flight = self._session.library.path(request.path_params["flight_id"])
        return [path.name for path in await asyncio.to_thread(recordings, flight)]

    async def waterfall(self, request: Request) -> Any:
        """Draw a recording's waterfall: ``?tag=2&start_s=0&length_s=60&recording=NAME``."""
        library, flight_id = self._session.library, request.path_params["flight_id"]
        flight, query = library.path(flight_id), request.query_params
        found = await asyncio.to_thread(recordings, flight)
        chosen = [one for one in found if one.name == query.get("recording", one.name)]
        if not chosen:
            raise NotFound(
                "this flight has no recorded samples on this computer",
                remedy="Fetch the flight from the drone with its recorded samples",
            )
        tag_id = int(_number(query.get("tag", ""), "tag"))
        summary = await asyncio.to_thread(library.summary, flight_id)
        tag = tag_of(summary.tags, tag_id)
        start_s = _number(query.get("start_s", "0"), "start_s")
        length_s = _number(query.get("length_s", "60"), "length_s")
        made = await asyncio.to_thread(recorded_picture, chosen[0], tag, start_s, length_s)
        return asdict(made)

    async def live_waterfall(self, request: Request) -> Any:
        """Start a live waterfall: ``{"address": "udp://127.0.0.1:20000"}``; "" ends it."""
        address = (await json_object(request)).get("address", "")
        await self._live.listen(str(address))
        return {"address": self._live.address}


def _number(text: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1e9:
        raise FormatError(f"{name} must be a number")
    return value
