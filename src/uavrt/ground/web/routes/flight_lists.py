"""Routes that list the flights on this computer and those of an archive."""

import asyncio
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from functools import partial
from typing import Any

from starlette.requests import Request

from uavrt.analysis.archive.parquet.flight_search import find_flights
from uavrt.core.errors import FormatError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.ground.session import GroundSession
from uavrt.ground.store.known_flights import FlightChoice
from uavrt.ground.web.routes.routing import Row, whole_number
from uavrt.ground.web.work.foreign_worker import ForeignWorker

MOST = 500
"""Maximum number of flights of an archive returned at once."""
FIRST_YEAR, LAST_YEAR = 1970, 2200
"""Years between which flights may be listed; 64-bit nanoseconds since 1970 end in 2262."""
_ALL = 10**9


class FlightListApi:
    """Lists flights by tag and day, in parts; `worker` reads untrusted archives."""

    def __init__(self, session: GroundSession, worker: ForeignWorker) -> None:
        self._session, self._worker = session, worker

    def routes(self) -> list[Row]:
        """List the routes for lists of flights."""
        return [
            Row("/flights", "GET", self.flights),
            Row("/found-flights", "GET", self.found),
            Row("/archive", "GET", self.archived),
        ]

    async def flights(self, request: Request) -> Any:
        """Return all flights on this computer, newest first."""
        return await asyncio.to_thread(self._session.library.summaries)

    async def found(self, request: Request) -> Any:
        """List some flights: ``?tag=4&from=2026-05-01&to=2026-05-02&after=0&limit=50``."""
        choice, (after, limit) = _choice(request), _page(request, _ALL)
        library = self._session.library
        total, flights = await asyncio.to_thread(library.find, choice, after, limit)
        return {"total": total, "flights": flights}

    async def archived(self, request: Request) -> Any:
        """Return some flights of the archive; ``directory`` is null if there is no archive."""
        choice, (after, limit) = _choice(request), _page(request, MOST)
        archive = self._session.vehicle.store.archive
        if archive is None:
            return {"directory": None, "total": 0, "flights": []}

        find = partial(find_flights, archive, **asdict(choice), after=after, limit=limit)
        found = await self._worker.call(find)
        # Where the flight is here, too, it can be opened.
        have = self._session.library.has
        flights = [{**asdict(one), "here": have(one.flight)} for one in found.flights]
        return {"directory": str(archive), "total": found.total, "flights": flights}


def _choice(request: Request) -> FlightChoice:
    """Read the criteria of a request; days are UTC, first and last included."""
    wanted = request.query_params
    first, last = (_day(wanted.get(name, ""), name) for name in ("from", "to"))
    return FlightChoice(
        tag_id=whole_number(request, "tag", 0, 2**31) if wanted.get("tag") else None,
        since_ns=None if first is None else _time_ns(first),
        before_ns=None if last is None else _time_ns(last + timedelta(days=1)),
    )


def _day(text: str, name: str) -> datetime | None:
    if not text:
        return None
    try:
        day = datetime.strptime(text, "%Y-%m-%d").replace(tzinfo=UTC)
    except ValueError as error:
        raise FormatError(f"{name} must be a day such as 2026-05-01") from error
    if not FIRST_YEAR <= day.year <= LAST_YEAR:
        raise FormatError(f"{name} must be a day from {FIRST_YEAR} to {LAST_YEAR}")
    return day


def _time_ns(day: datetime) -> int:
    return int(day.timestamp()) * NANOSECONDS_PER_SECOND


def _page(request: Request, most: int) -> tuple[int, int]:
    limit = whole_number(request, "limit", min(50, most), most)
    return whole_number(request, "after", 0, _ALL), limit
