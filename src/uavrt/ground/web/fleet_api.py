"""Routes by which a page lets further vehicles be served."""

from collections.abc import Awaitable, Callable
from typing import Any

from starlette.requests import Request

from uavrt.errors import UsageError
from uavrt.ground.fleet import Fleet
from uavrt.ground.web.api import json_body


class FleetApi:
    """All vehicles of a ground station.

    Parameters
    ----------
    fleet : Fleet
        Who serves them.
    """

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet

    def routes(self) -> list[tuple[str, str, Callable[[Request], Awaitable[Any]]]]:
        """Path below ``/api``, method, handler."""
        return [
            ("/vehicles", "GET", self.vehicles),
            ("/vehicles", "POST", self.serve),
            ("/vehicles/{number:int}", "DELETE", self.leave),
        ]

    async def vehicles(self, request: Request) -> Any:
        """All that are served."""
        return self._fleet.records()

    async def serve(self, request: Request) -> Any:
        """Serve another, too: ``{"system_id": 2}``."""
        self._fleet.first.commander.check(request.headers.get("x-page"))
        wanted = await json_body(request)
        number = wanted.get("system_id") if isinstance(wanted, dict) else None
        if not isinstance(number, int) or isinstance(number, bool):
            raise UsageError("system_id must be a vehicle's number, 1 to 255")
        self._fleet.serve(number)
        return self._fleet.records()

    async def leave(self, request: Request) -> Any:
        """Serve one no more; what it does goes on."""
        self._fleet.first.commander.check(request.headers.get("x-page"))
        await self._fleet.leave(int(request.path_params["number"]))
        return self._fleet.records()
