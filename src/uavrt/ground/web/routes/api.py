"""Routes of one vehicle. docs/reference/ground-api.md describes all routes."""

import asyncio
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from starlette.requests import Request

from uavrt.analysis.season import read_season
from uavrt.config.loader import load_settings
from uavrt.config.settings import RecordingSettings
from uavrt.core.errors import CommandRefused, FormatError, LinkError, UsageError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.drone.computer.bench import FlightFacts, first_flight
from uavrt.drone.computer.finding import Finding
from uavrt.ground.link.button_states import BUTTONS
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.session import GroundSession
from uavrt.ground.store import tag_table
from uavrt.ground.store.coordinates import readout
from uavrt.ground.web.routes import map_routes as maps
from uavrt.ground.web.routes.flight_api import FlightApi
from uavrt.ground.web.routes.motion_api import MotionApi
from uavrt.ground.web.routes.page_records import MAX_PAGE_NAME
from uavrt.ground.web.routes.routing import Answer, Row, json_object, page_of
from uavrt.ground.web.routes.tag_api import TagApi
from uavrt.ground.web.work.exports import EXPORTS
from uavrt.ground.web.work.foreign_worker import ForeignWorker
from uavrt.ground.web.work.report_facts import change_facts, facts_in
from uavrt.ground.web.work.serial_ports import serial_ports
from uavrt.localization.antenna import MONOPOLE, PATTERNS

FOR_ALL = ("mark", *(button.action for button in BUTTONS if button.any_page))
"""Commands allowed to every page: stops, which are urgent, and marks, which are harmless."""


class Api:
    """State, settings and commands of one vehicle."""

    def __init__(
        self, session: GroundSession, drone_settings: Path | None, worker: ForeignWorker
    ) -> None:
        self._session, self._vehicle = session, session.vehicle
        self._worker = worker
        self._drone_settings = drone_settings
        self._maps = session.vehicle.store.directory / "maps"

    def routes(self) -> list[Row]:
        """List the routes of a vehicle's state, settings and commands."""
        return [
            Row("/state", "GET", self.state),
            Row("/first-flight", "GET", self.first_flight),
            Row("/settings", "GET", self.settings),
            Row("/settings", "PUT", self.put_settings, commands=True),
            Row("/facts", "GET", self.facts),
            Row("/facts", "PUT", self.put_facts, commands=True),
            Row("/choices", "GET", self.choices),
            Row("/connection", "POST", self.connect, commands=True),
            Row("/vehicle", "POST", self.choose_vehicle, commands=True),
            Row("/commander", "POST", self.command_from_here),
            Row("/maps/{name}", "PUT", self.put_map),
            Row("/commands/{name}", "POST", self.command),
            Row("/parameters", "POST", self.parameters, commands=True),
            Row("/readout", "GET", self.readout),
            Row("/log", "GET", self.log),
            Row("/season", "GET", self.season),
        ]

    async def state(self, request: Request) -> Any:
        """Return the complete state of drone, link and flight."""
        return self._session.snapshot()

    async def first_flight(self, request: Request) -> Any:
        """Return the checklist before a first flight, with a remedy for each item."""
        library, keeper = self._session.library, self._vehicle.flight.keeper
        live = None if keeper.ended else keeper.flight_id
        number = self._vehicle.identity.system_id
        noise_db = await asyncio.to_thread(library.usual_noise_db, number, but=live)
        findings = _first_flight(self._vehicle, noise_db)
        if self._drone_settings is not None:
            findings += await asyncio.to_thread(_card_and_clock, self._drone_settings)
        return [asdict(finding) for finding in findings]

    async def settings(self, request: Request) -> Any:
        """Return the ground station's settings for this vehicle."""
        return asdict(self._vehicle.store.settings)

    async def put_settings(self, request: Request) -> Any:
        """Change the given settings, and return all settings."""
        store = self._vehicle.store
        wanted = store.settings.changed(await json_object(request))
        await store.disk.run(store.set_settings, wanted)
        self._session.settings_changed()
        return asdict(store.settings)

    async def facts(self, request: Request) -> Any:
        """Return the texts for reports, such as operator and species."""
        return await asyncio.to_thread(facts_in, self._vehicle.store.directory)

    async def put_facts(self, request: Request) -> Any:
        """Change some texts; they apply to all flights without a report.toml of their own."""
        values, folder = await json_object(request), self._vehicle.store.directory
        return await asyncio.to_thread(change_facts, folder, values)

    async def choices(self, request: Request) -> Any:
        """Return the choices in the settings form: serial ports, antennas, presets and maps."""
        listed = []
        # Most stations have no maps, and need no process to read them.
        if await asyncio.to_thread(maps.map_paths, self._maps):
            listed = await self._worker.call(maps.map_list, self._maps)
        return {
            "ports": await asyncio.to_thread(serial_ports),
            "antennas": {
                **{
                    name: {"e_plane_db": pattern.e_plane_db}
                    for name, pattern in PATTERNS.items()
                },
                MONOPOLE: {"e_plane_db": None},
            },
            "presets": tag_table.PRESETS,
            "maps": listed,
            "maps_directory": str(self._maps.absolute()),
            "exports": list(EXPORTS),
        }

    async def connect(self, request: Request) -> Any:
        """Connect to an address; an empty address disconnects."""
        if self._vehicle.store.system_id is not None:
            raise UsageError(
                "an added vehicle uses the links of the main page; change the address there"
            )
        address = (await json_object(request)).get("address")
        if address:
            store = self._vehicle.store
            changed = store.settings.changed({"address": address})
            await store.disk.run(store.set_settings, changed)
            self._session.settings_changed()
            await self._vehicle.connect()
        else:
            await self._vehicle.disconnect()
            self._vehicle.feed.send_state()
        return self._session.snapshot()["connection"]

    async def choose_vehicle(self, request: Request) -> Any:
        """Serve another vehicle on this link: ``{"system_id": 2}``."""
        number = (await json_object(request)).get("system_id")
        if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= 255:
            raise UsageError("system_id must be a vehicle's number, 1 to 255")
        self._session.choose_vehicle(number)
        return self._session.snapshot()["drone"]

    async def command_from_here(self, request: Request) -> Any:
        """Give command to the requesting page; the page that had it may then only watch."""
        page = page_of(request)
        if not page or len(page) > MAX_PAGE_NAME:
            raise UsageError("only a web page can take command, not a script")
        self._session.commander.claim(page)
        self._vehicle.feed.note(5, "another page has taken command")
        self._vehicle.feed.send_state()
        return {"commander": page}

    async def put_map(self, request: Request) -> Any:
        """Store the request body as a map file."""
        name = request.path_params["name"]
        return await maps.store_map(self._maps, name, request.stream(), self._worker)

    async def command(self, request: Request) -> Any:
        """Send a command to the drone; return its acknowledgement."""
        commands = self._session.commands.by_name(await json_object(request))
        name = request.path_params["name"]
        if name not in commands:
            return Answer(404, {"error": f"there is no command {name[:40]!r}"})
        try:
            if name not in FOR_ALL:
                self._session.commander.check(page_of(request))
            return {"accepted": True, "message": await commands[name]()}
        except (CommandRefused, LinkError) as error:
            return Answer(409, {"accepted": False, "message": str(error)})

    async def parameters(self, request: Request) -> Any:
        """Request the drone's parameters over the radio."""
        return await self._session.commands.parameters()

    async def readout(self, request: Request) -> Any:
        """Format a position in every notation: ``?latitude_deg=…&longitude_deg=…``."""
        try:
            latitude = float(request.query_params.get("latitude_deg", ""))
            longitude = float(request.query_params.get("longitude_deg", ""))
        except ValueError:
            latitude = longitude = float("nan")
        if not (-90.0 <= latitude <= 90.0 and -360.0 <= longitude <= 360.0):
            raise FormatError("latitude_deg and longitude_deg must be a position on earth")
        return asdict(readout(latitude, longitude))

    async def log(self, request: Request) -> Any:
        """Return the latest lines of the operator's log."""
        return self._vehicle.feed.log.lines()

    async def season(self, request: Request) -> Any:
        """Summary of all flights on this computer, as `uavrt season` makes it."""
        return asdict(await asyncio.to_thread(read_season, self._session.library.directory))


def _first_flight(vehicle: ServedVehicle, noise_db: float | None) -> list[Finding]:
    """Check whether all is ready for a first flight; compares the noise with past flights."""
    now_ns, watch, drone = vehicle.clock.now_ns(), vehicle.connection.watch, vehicle.drone
    pose = watch.pose if watch else None
    facts = FlightFacts(
        tags=vehicle.store.chosen_tags,
        state=drone.state,
        heard=vehicle.connection.present(now_ns),
        clock_off_s=None if drone.skew_ns is None else drone.skew_ns / NANOSECONDS_PER_SECOND,
        pose_age_s=None if pose is None else (now_ns - pose.time_ns) / NANOSECONDS_PER_SECOND,
        disk_free_mb=watch.disk_free_mb if watch else None,
        disk_needed_mb=RecordingSettings().minimum_free_mb,
        battery_percent=watch.battery_percent if watch else None,
        battery_v=watch.battery_v if watch else None,
        usual_noise_db=noise_db,
    )
    return first_flight(facts, drone.bench, now_ns)


def _card_and_clock(drone_settings: Path) -> list[Finding]:
    """Check the clock, and the drone's memory card if it is in this computer."""
    from uavrt.drone.computer.computer_checks import check_card, check_kept_time

    settings = load_settings(drone_settings)
    directory = str(drone_settings.parent / settings.recording.directory)
    recording = replace(settings.recording, directory=directory)
    return [check_card(replace(settings, recording=recording)), check_kept_time()]


def api_rows(
    session: GroundSession, worker: ForeignWorker, drone_settings: Path | None = None
) -> Iterable[Row]:
    """List all routes of one vehicle's session."""
    vehicle = session.vehicle
    yield from Api(session, drone_settings, worker).routes()
    yield from TagApi(vehicle, worker).routes()
    yield from MotionApi(session.flying, vehicle.store, worker).routes()
    yield from FlightApi(vehicle.store, session.library).routes()
