"""Routes to add further vehicles, and to send a command to all vehicles at once."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from starlette.requests import Request

from uavrt.core.errors import UavrtError
from uavrt.ground.fleet import Fleet
from uavrt.ground.link.command_sender import Commands
from uavrt.ground.link.page_values import whole_in
from uavrt.ground.session import GroundSession
from uavrt.ground.web.routes.api import FOR_ALL
from uavrt.ground.web.routes.routing import Answer, Row, json_object, page_of

TO_ALL: dict[str, Callable[[Commands], Awaitable[str]]] = {
    "send_tags": Commands.send_tags,
    "start": Commands.start,
    "stop": Commands.stop,
}
"""Commands that may be sent to all vehicles at once; none moves a vehicle."""


class FleetApi:
    """Routes for all vehicles of a ground station."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet

    def routes(self) -> list[Row]:
        """List the routes for all vehicles."""
        return [
            Row("/vehicles", "GET", self.vehicles),
            Row("/vehicles", "POST", self.serve, commands=True),
            Row("/vehicles/{number:int}", "DELETE", self.leave, commands=True),
            Row("/vehicles/commands/{name}", "POST", self.command),
        ]

    async def vehicles(self, request: Request) -> Any:
        """List the served vehicles."""
        return self._fleet.records()

    async def serve(self, request: Request) -> Any:
        """Serve a further vehicle: ``{"system_id": 2}``."""
        await self._fleet.serve(whole_in(await json_object(request), "system_id"))
        return self._fleet.records()

    async def leave(self, request: Request) -> Any:
        """Stop serving an added vehicle; no command is sent to it."""
        await self._fleet.leave(int(request.path_params["number"]))
        return self._fleet.records()

    async def command(self, request: Request) -> Any:
        """Send the same command to all vehicles that the page may command.

        A refusal by one vehicle does not affect the others.
        """
        name, page = request.path_params["name"], page_of(request)
        if name not in TO_ALL:
            known = ", ".join(TO_ALL)
            return Answer(
                404,
                {"error": f"{name[:40]!r} cannot be sent to all vehicles; choose from {known}"},
            )
        answers = await asyncio.gather(
            *(_answer(session, name, page) for session in self._fleet.sessions)
        )
        return {"accepted": all(one["accepted"] for one in answers), "answers": answers}


async def _answer(session: GroundSession, action: str, page: str | None) -> dict[str, Any]:
    """Send a command to one vehicle if the page may command it; return answer or refusal."""
    who = {
        "system_id": session.vehicle.identity.system_id,
        "name": session.vehicle.store.settings.vehicle_name,
    }
    try:
        if action not in FOR_ALL:
            session.commander.check(page)
        return who | {"accepted": True, "message": await TO_ALL[action](session.commands)}
    except UavrtError as error:
        return who | {"accepted": False, "message": str(error)}
