"""Routes of one recorded flight."""

import asyncio
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from starlette.requests import Request
from starlette.responses import Response

from uavrt.core.errors import FormatError
from uavrt.ground.store.estimates import AntennaChoice, Estimates, Estimator
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored_flights import PULSE_COLUMNS, FlightLibrary
from uavrt.ground.store.tag_table import rows_from_tags
from uavrt.ground.web.routes.routing import Answer, Row, download, json_object, whole_number
from uavrt.ground.web.work.column_answers import POSE_COLUMNS, chosen_columns, thinned
from uavrt.ground.web.work.exports import EXPORTS, export
from uavrt.ground.web.work.flight_maps import (
    CoverageMapJobs,
    CoverageMapRequest,
    integrated_record,
)
from uavrt.ground.web.work.integration_jobs import IntegrationJobs, fold_pictures
from uavrt.ground.web.work.report_jobs import POLICY, Reporter

T = TypeVar("T")


class FlightApi:
    """Routes for each flight of a library; estimates use the configured antenna."""

    def __init__(self, store: GroundStore, library: FlightLibrary) -> None:
        self._store, self._library = store, library
        self._estimates: dict[tuple[Any, ...], Estimates] = {}
        self._reporter = Reporter(store.directory / "reports")
        self._silence = CoverageMapJobs()
        self._integration = IntegrationJobs()

    def routes(self) -> list[Row]:
        """List the routes of one recorded flight."""
        flight = "/flights/{flight_id}"
        return [
            Row(flight, "GET", self.flight),
            Row(f"{flight}/star", "PUT", self.star),
            Row(f"{flight}/pulses", "GET", self.pulses),
            Row(f"{flight}/columns", "GET", self.columns),
            Row(f"{flight}/track", "GET", self.track),
            Row(f"{flight}/estimates", "GET", self.estimates),
            Row(f"{flight}/integrated", "GET", self.integrated),
            Row(f"{flight}/integrate", "POST", self.integrate, commands=True),
            Row(f"{flight}/folds", "GET", self.folds),
            Row(f"{flight}/silence", "POST", self.silence),
            Row(f"{flight}/absence", "POST", self.absence),
            Row(f"{flight}/export/{{name}}", "GET", self.export),
            Row(f"{flight}/report", "GET", self.report),
        ]

    @property
    def _antenna(self) -> AntennaChoice:
        return self._store.settings.antenna_choice

    async def _of(self, request: Request, read: Callable[..., T], *more: object) -> T:
        """Call a function with the requested flight in a thread; return its result."""
        return await asyncio.to_thread(read, request.path_params["flight_id"], *more)

    async def _path(self, request: Request) -> Path:
        return await self._of(request, self._library.path)

    async def flight(self, request: Request) -> Any:
        """Get a flight's summary, tags and log."""
        summary = await self._of(request, self._library.summary)
        log = await self._of(request, self._library.log)
        places = await self._of(request, self._library.places)
        home = places.home
        return {
            **asdict(summary),
            "rows": rows_from_tags(summary.tags),
            "log": log,
            "home": home and {"latitude_deg": home[0], "longitude_deg": home[1]},
            "marks": [asdict(mark) for mark in places.marks],
        }

    async def star(self, request: Request) -> Any:
        """Protect a flight from removal, or end the protection: ``{"starred": true}``."""
        starred = (await json_object(request)).get("starred")
        if not isinstance(starred, bool):
            raise FormatError("starred must be true or false")
        await self._of(request, self._library.star, starred)
        return {"flight_id": request.path_params["flight_id"], "starred": starred}

    async def pulses(self, request: Request) -> Any:
        """Return some pulses as records: ``?after=0&limit=1000``."""
        after = whole_number(request, "after", 0, 2**31)
        limit = whole_number(request, "limit", 1000, 10_000)
        return await self._of(request, self._library.records, after, limit)

    async def columns(self, request: Request) -> Any:
        """Pulses as float64 columns named in a header; ``?names=tag_id,yaw_deg`` selects."""
        names = request.query_params.get("names")
        return await self._of(
            request,
            lambda flight_id: chosen_columns(
                self._library.pulses(flight_id), PULSE_COLUMNS, names
            ),
        )

    async def track(self, request: Request) -> Any:
        """Return the vehicle's poses in columns; ``?most=20000`` thins them evenly."""
        names = request.query_params.get("names")
        most = whole_number(request, "most", 10**9, 10**9)
        return await self._of(
            request,
            lambda flight_id: chosen_columns(
                thinned(self._library.poses(flight_id), most), POSE_COLUMNS, names
            ),
        )

    async def estimates(self, request: Request) -> Any:
        """Return a flight's bearings and positions, computed for the configured antenna."""
        antenna = self._antenna
        summary = await self._of(request, self._library.summary)
        key = (summary.flight_id, summary.pulses, antenna)
        if key not in self._estimates:
            columns = await self._of(request, self._library.columns)
            estimator, place = Estimator(), await self._path(request)
            past = await asyncio.to_thread(estimator.past, place, antenna)
            self._estimates.clear()
            self._estimates[key] = await asyncio.to_thread(
                estimator.estimate, columns, antenna, (), summary.tags, (), past
            )
        return self._estimates[key].record()

    async def integrated(self, request: Request) -> Any:
        """Return the results that ``uavrt integrate`` has computed for a flight."""
        return await asyncio.to_thread(integrated_record, await self._path(request))

    async def integrate(self, request: Request) -> Any:
        """Start a search of a whole flight for weak tags, or return its progress."""
        path = await self._path(request)
        return await self._integration.answer(path, self._store.settings.dem)

    async def folds(self, request: Request) -> Any:
        """Return pictures of a flight's samples, folded at the interval of each tag."""
        return await asyncio.to_thread(fold_pictures, await self._path(request))

    async def silence(self, request: Request) -> Any:
        """Return the map of where a tag would have been detected, or the map's progress."""
        path, wanted = await self._path(request), await json_object(request)
        asked = CoverageMapRequest.from_request(path, self._antenna, wanted)
        return await asyncio.to_thread(
            self._silence.answer, asked, again=wanted.get("again") is True
        )

    async def absence(self, request: Request) -> Any:
        """Return the probability that an undetected tag is outside an outline."""
        path, wanted = await self._path(request), await json_object(request)
        asked = CoverageMapRequest.from_request(path, self._antenna, wanted)
        return await asyncio.to_thread(self._silence.absence, asked, wanted)

    async def export(self, request: Request) -> Any:
        """Return a flight as a file for other programs."""
        name = request.path_params["name"]
        if name not in EXPORTS:
            return Answer(404, {"error": f"there is no export {name[:40]!r}"})
        path = await self._path(request)
        content = await asyncio.to_thread(export, name, path, self._antenna)
        flight_id = request.path_params["flight_id"]
        return download(content, f"{flight_id}.{name}", EXPORTS[name].media_type)

    async def report(self, request: Request) -> Any:
        """Return the report of a flight as HTML."""
        content = await self._reporter.report(await self._path(request), self._antenna)
        headers = {"Content-Security-Policy": POLICY}
        return Response(content, media_type="text/html", headers=headers)
