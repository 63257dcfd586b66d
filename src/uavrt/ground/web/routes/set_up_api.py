"""Routes of a drone's first set-up, available if the page runs on the drone's own computer."""

import asyncio
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starlette.requests import Request
from starlette.responses import Response

from uavrt.config.loader import load_settings
from uavrt.core.errors import UavrtError
from uavrt.core.messages import SystemStatus
from uavrt.ground.session import GroundSession
from uavrt.ground.web.routes.routing import Answer, Row, json_object

if TYPE_CHECKING:
    from uavrt.drone.computer.first_setup import FirstSetup


class SetUpApi:
    """Routes of the steps of `uavrt.drone.computer.first_setup`."""

    def __init__(self, session: GroundSession, setup: "FirstSetup") -> None:
        self._session, self._setup = session, setup

    def routes(self) -> list[Row]:
        """List the routes of the drone's first set-up."""
        return [
            Row("/set-up", "GET", self.state),
            Row("/set-up/finish", "POST", self.finish, commands=True),
            Row("/set-up/command.key", "GET", self.command_key),
            Row("/set-up/{step}", "PUT", self.save_step, commands=True),
            Row("/set-up/{step}/test", "POST", self.test, commands=True),
        ]

    async def state(self, request: Request) -> Any:
        """Return whether the set-up is unfinished, and values and choices for each step."""
        setup = self._setup
        if not setup.wanted:
            return {"wanted": False}
        return {
            "wanted": True,
            "done": sorted(setup.done),
            "values": await asyncio.to_thread(setup.values),
            "choices": await asyncio.to_thread(setup.choices),
        }

    async def save_step(self, request: Request) -> Any:
        """Check and store a step; answers with its new values, or 422 and the faults."""
        setup = self._setup
        body = await json_object(request)
        faults = await asyncio.to_thread(setup.save_step, request.path_params["step"], body)
        if faults:
            return Answer(422, {"faults": [asdict(fault) for fault in faults]})
        return {"faults": [], "values": await asyncio.to_thread(setup.values)}

    async def test(self, request: Request) -> Any:
        """Test the radio or the autopilot's link with the stored settings."""
        setup = self._setup

        def findings() -> list[dict[str, Any]]:
            running = _running(setup.config)
            return [asdict(one) for one in setup.test(request.path_params["step"], running)]

        return await asyncio.to_thread(findings)

    async def finish(self, request: Request) -> Any:
        """Finish the set-up; update the page's own settings."""
        setup = self._setup
        values = await asyncio.to_thread(setup.values)
        finished = await asyncio.to_thread(setup.finish)
        store = self._session.vehicle.store
        own = {"vehicle_name": values["name"], "antenna": values["antenna"]}
        await store.disk.run(store.set_settings, store.settings.changed(own))
        self._session.settings_changed()
        return finished

    async def command_key(self, request: Request) -> Any:
        """The drone's command key as a file, for a laptop that commands the drone."""
        key = await asyncio.to_thread(self._setup.command_key)
        attached = {"Content-Disposition": 'attachment; filename="command.key"'}
        return Response(key, media_type="text/plain", headers=attached)


def set_up_rows(session: GroundSession, config: Path | None) -> list[Row]:
    """List the routes of the set-up; `config` is None if the page runs elsewhere."""
    if config is None:
        return [Row("/set-up", "GET", _unwanted)]
    # Only a drone's computer has what it looks at; the page of a laptop runs anywhere.
    from uavrt.drone.computer import first_setup

    return SetUpApi(session, first_setup.FirstSetup(config)).routes()


async def _unwanted(_request: Request) -> Any:
    return {"wanted": False}


def _running(config: Path) -> SystemStatus | None:
    """State of the drone side on this computer; None if it is not running."""
    from uavrt.drone.status_reader import running_status, status_socket_path

    try:
        settings = load_settings(config)
    except UavrtError:
        return None
    return running_status(config.parent / status_socket_path(settings))
