"""The routes of the ground station's server; docs/reference/ground-api.md describes them."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.websockets import WebSocket, WebSocketDisconnect

from uavrt.analysis.season import read_season
from uavrt.computer.finding import Finding
from uavrt.config.loader import load_settings
from uavrt.errors import CommandRefused, FormatError, LinkError, UavrtError, UsageError
from uavrt.ground.link.actions import BUTTONS
from uavrt.ground.listeners import encode
from uavrt.ground.session import GroundSession
from uavrt.ground.store import tag_table
from uavrt.ground.store.coordinates import readout
from uavrt.ground.store.estimates import AntennaChoice, Estimator
from uavrt.ground.store.flights import PULSE_COLUMNS, Columns
from uavrt.ground.web import maps
from uavrt.ground.web.column_answers import POSE_COLUMNS, chosen_columns, thinned
from uavrt.ground.web.exports import EXPORTS, export
from uavrt.ground.web.facts import tell_facts, told_facts
from uavrt.ground.web.first_flight import first_flight_findings, usual_noise_db
from uavrt.ground.web.foreign_requests import (
    area_in_body,
    checked_tags,
    imported_tags,
    read_body,
)
from uavrt.ground.web.foreign_worker import ForeignWorker
from uavrt.ground.web.foresight import Foresight, foresight_desk
from uavrt.ground.web.hindsight import Silence, SilenceDesk, integrated_record
from uavrt.ground.web.integrating import IntegrationDesk, fold_pictures
from uavrt.ground.web.map_desk import asks_again
from uavrt.ground.web.reports import POLICY, Reporter
from uavrt.ground.web.serial_ports import serial_ports
from uavrt.localization.antenna import MONOPOLE, PATTERNS
from uavrt.messages import Tag
from uavrt.recording.places import Places

MAX_PAGE_NAME = 64
FOR_ALL = ("mark", *(button.action for button in BUTTONS if button.any_page))
"""What a page may ask that only looks on: to stop can be urgent, a mark harms nothing."""


class Api:
    """The routes; each returns something for JSON, or a response.

    `session`: what is shown and commanded.
    `drone_settings`: ``uavrt.toml`` of the drone side, where the page runs on the drone's own
    computer.
    `worker`: reads what others made; by default one of its own.
    """

    def __init__(
        self,
        session: GroundSession,
        drone_settings: Path | None = None,
        worker: ForeignWorker | None = None,
    ) -> None:
        self._session = session
        self._worker = worker or ForeignWorker()
        self._drone_settings = drone_settings
        self._estimates: dict[tuple[Any, ...], Any] = {}
        self._reporter = Reporter(session.vehicle.store.directory / "reports")
        self._silence = SilenceDesk()
        self._foresight = foresight_desk()
        self._integration = IntegrationDesk()

    def routes(self) -> list[tuple[str, str, Callable[[Request], Awaitable[Any]]]]:
        """Path below ``/api``, method, handler."""
        return [
            ("/state", "GET", self.state),
            ("/first-flight", "GET", self.first_flight),
            ("/tags", "GET", self.tags),
            ("/tags", "PUT", self.put_tags),
            ("/tags/check", "POST", self.check_tags),
            ("/tags/import", "POST", self.import_tags),
            ("/tags/{name}", "GET", self.export_tags),
            ("/settings", "GET", self.settings),
            ("/settings", "PUT", self.put_settings),
            ("/facts", "GET", self.facts),
            ("/facts", "PUT", self.put_facts),
            ("/choices", "GET", self.choices),
            ("/connection", "POST", self.connect),
            ("/vehicle", "POST", self.choose_vehicle),
            ("/commander", "POST", self.command_from_here),
            ("/maps/{name}", "PUT", self.put_map),
            ("/commands/{name}", "POST", self.command),
            ("/motion/area", "POST", self.motion_area),
            ("/motion/plan", "POST", self.motion_plan),
            ("/motion/coverage", "POST", self.motion_coverage),
            ("/motion/upload", "POST", self.motion_upload),
            ("/motion/ask", "POST", self.motion_ask),
            ("/motion/confirm", "POST", self.motion_confirm),
            ("/motion/stop", "POST", self.motion_stop),
            ("/parameters", "POST", self.parameters),
            ("/readout", "GET", self.readout),
            ("/log", "GET", self.log),
            ("/season", "GET", self.season),
            ("/flights/{flight_id}", "GET", self.flight),
            ("/flights/{flight_id}/star", "PUT", self.star),
            ("/flights/{flight_id}/pulses", "GET", self.pulses),
            ("/flights/{flight_id}/columns", "GET", self.columns),
            ("/flights/{flight_id}/track", "GET", self.track),
            ("/flights/{flight_id}/estimates", "GET", self.estimates),
            ("/flights/{flight_id}/integrated", "GET", self.integrated),
            ("/flights/{flight_id}/integrate", "POST", self.integrate),
            ("/flights/{flight_id}/folds", "GET", self.folds),
            ("/flights/{flight_id}/silence", "POST", self.silence),
            ("/flights/{flight_id}/absence", "POST", self.absence),
            ("/flights/{flight_id}/export/{name}", "GET", self.export),
            ("/flights/{flight_id}/report", "GET", self.report),
        ]

    async def state(self, request: Request) -> Any:
        """Everything known about drone, link and flight."""
        return self._session.snapshot()

    async def first_flight(self, request: Request) -> Any:
        """The list before a first flight, each item with its remedy."""
        vehicle = self._session.vehicle
        noise_db = await asyncio.to_thread(usual_noise_db, vehicle, self._session.library)
        findings = first_flight_findings(vehicle, noise_db)
        if self._drone_settings is not None:
            findings += await asyncio.to_thread(_card_and_clock, self._drone_settings)
        return [asdict(finding) for finding in findings]

    async def tags(self, request: Request) -> Any:
        """The tag table."""
        return tag_table.rows_from_tags(self._session.vehicle.store.tags)

    async def put_tags(self, request: Request) -> Any:
        """Store the tag table if it has no faults; otherwise report all of them.

        With ``If-Match: "VERSION"`` only while the table is still that one: another page may
        have changed it.
        """
        self._check_commander(request)
        rows = await json_body(request)
        tags, faults = await self._worker.call(tag_table.tags_from_rows, rows)
        if faults:
            return Answer(422, {"faults": [asdict(fault) for fault in faults]})
        store = self._session.vehicle.store
        wanted = request.headers.get("if-match", "*").strip('" ')

        def keep() -> bool:
            same = wanted in ("*", tag_table.table_version(store.tags))
            if same:
                store.set_tags(tags)
            return same

        if not await store.disk.run(keep):
            changed = "the tags were changed by another page meanwhile"
            return Answer(412, {"error": changed, **_tag_answer(store.tags)})
        self._session.vehicle.show_tags()
        return {"faults": [], **_tag_answer(tags)}

    async def check_tags(self, request: Request) -> Any:
        """Report the faults of a table that is being typed; without any, what may surprise."""
        checked = await self._worker.call(checked_tags, await request.body())
        return checked | {"faults": [asdict(fault) for fault in checked["faults"]]}

    async def import_tags(self, request: Request) -> Any:
        """Read rows from files, and what these do not fly with; nothing is kept yet."""
        return await self._worker.call(imported_tags, await request.body())

    async def export_tags(self, request: Request) -> Any:
        """Write the table as a file."""
        name = request.path_params["name"]
        text = tag_table.export_text(self._session.vehicle.store.tags, name)
        return _download(text.encode(), name, "text/plain; charset=utf-8")

    async def settings(self, request: Request) -> Any:
        """The set-up."""
        return asdict(self._session.vehicle.store.settings)

    async def put_settings(self, request: Request) -> Any:
        """Change some of the set-up."""
        self._check_commander(request)
        store = self._session.vehicle.store
        wanted = store.settings.changed(await json_body(request))
        await store.disk.run(store.set_settings, wanted)
        self._session.settings_changed()
        return asdict(store.settings)

    async def facts(self, request: Request) -> Any:
        """What reports tell of who flew what."""
        return await asyncio.to_thread(told_facts, self._session.vehicle.store.directory)

    async def put_facts(self, request: Request) -> Any:
        """Change some of it, for all flights that have no report.toml of their own."""
        self._check_commander(request)
        told, folder = await json_body(request), self._session.vehicle.store.directory
        return await asyncio.to_thread(tell_facts, folder, told)

    async def choices(self, request: Request) -> Any:
        """The choices: serial ports, antennas, presets, maps."""
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
            "maps": await self._worker.call(
                maps.map_list, self._session.vehicle.store.directory / "maps"
            ),
            "maps_directory": str((self._session.vehicle.store.directory / "maps").absolute()),
            "exports": list(EXPORTS),
        }

    async def connect(self, request: Request) -> Any:
        """Connect to an address; an empty one disconnects."""
        self._check_commander(request)
        if self._session.vehicle.store.system_id is not None:
            raise UsageError("further vehicles are on the links of the first page")
        wanted = await json_body(request)
        address = wanted.get("address") if isinstance(wanted, dict) else None
        if address:
            store = self._session.vehicle.store
            changed = store.settings.changed({"address": address})
            await store.disk.run(store.set_settings, changed)
            self._session.settings_changed()
            await self._session.vehicle.connect()
        else:
            await self._session.vehicle.disconnect()
            self._session.vehicle.feed.send_state()
        return self._session.snapshot()["connection"]

    async def choose_vehicle(self, request: Request) -> Any:
        """Serve another vehicle of this link: ``{"system_id": 2}``."""
        self._check_commander(request)
        wanted = await json_body(request)
        number = wanted.get("system_id") if isinstance(wanted, dict) else None
        if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= 255:
            raise UsageError("system_id must be a vehicle's number, 1 to 255")
        self._session.choose_vehicle(number)
        return self._session.snapshot()["drone"]

    async def command(self, request: Request) -> Any:
        """Ask something of the drone; the answer is its acknowledgement."""
        commands = self._session.commands.by_name(await json_body(request))
        name = request.path_params["name"]
        if name not in commands:
            return Answer(404, {"error": f"there is no command {name[:40]!r}"})
        try:
            if name not in FOR_ALL:
                self._check_commander(request)
            return {"accepted": True, "message": await commands[name]()}
        except (CommandRefused, LinkError) as error:
            return Answer(409, {"accepted": False, "message": str(error)})

    async def motion_area(self, request: Request) -> Any:
        """Corners of an area: ``{"name": …, "text": …}`` of a file, or centre and radius."""
        return await self._worker.call(area_in_body, await request.body())

    async def motion_plan(self, request: Request) -> Any:
        """Where a motion would lead; the drone is not asked."""
        return self._session.flying.plan(await json_body(request))

    async def motion_coverage(self, request: Request) -> Any:
        """The map of where a tag would be heard along a plan, or how far it is."""
        store, wanted = self._session.vehicle.store, await json_body(request)
        asked = Foresight.asked(wanted, store.tags, store.settings.antenna_choice)
        return await asyncio.to_thread(self._foresight.answer, asked, again=asks_again(wanted))

    async def motion_upload(self, request: Request) -> Any:
        """Give a survey to the autopilot as its mission. Nothing moves by it."""
        self._check_commander(request)
        wish = await json_body(request)
        return await self._session.flying.upload(wish, self._worker.call)

    async def motion_ask(self, request: Request) -> Any:
        """Ask the drone for a motion: its offer, or its reason not to. Nothing moves by it."""
        self._check_commander(request)
        page = request.headers.get("x-page")
        return await self._session.flying.ask(await json_body(request), page)

    async def motion_confirm(self, request: Request) -> Any:
        """Confirm the offer, ``{"order_id": …, "sticks_unseen": false}``: it moves."""
        self._check_commander(request)
        page = request.headers.get("x-page")
        return await self._session.flying.confirm(await json_body(request), page)

    async def motion_stop(self, request: Request) -> Any:
        """Take the drone back: it stands. Everybody may."""
        return await self._session.flying.stop()

    async def parameters(self, request: Request) -> Any:
        """The drone's parameters, requested from it now over the radio."""
        self._check_commander(request)
        return await self._session.commands.parameters()

    async def readout(self, request: Request) -> Any:
        """A place in every way of writing: ``?latitude_deg=…&longitude_deg=…``."""
        try:
            latitude = float(request.query_params.get("latitude_deg", ""))
            longitude = float(request.query_params.get("longitude_deg", ""))
        except ValueError:
            latitude = longitude = float("nan")
        if not (-90.0 <= latitude <= 90.0 and -360.0 <= longitude <= 360.0):
            raise FormatError("latitude_deg and longitude_deg must be a place on earth")
        return readout(latitude, longitude).as_dict()

    async def log(self, request: Request) -> Any:
        """The operator's log."""
        return self._session.vehicle.feed.log.lines()

    async def season(self, request: Request) -> Any:
        """All flights on this computer in numbers, as `uavrt season` gives them."""
        return asdict(await asyncio.to_thread(read_season, self._session.library.directory))

    async def flight(self, request: Request) -> Any:
        """One flight: its summary, tags and log."""
        library, flight_id = self._session.library, _flight_id(request)
        summary = await asyncio.to_thread(library.summary, flight_id)
        return {
            **asdict(summary),
            "rows": tag_table.rows_from_tags(summary.tags),
            "log": await asyncio.to_thread(library.log, flight_id),
            **_place_records(await asyncio.to_thread(library.places, flight_id)),
        }

    async def star(self, request: Request) -> Any:
        """Keep a flight from being removed, or no longer: ``{"starred": true}``."""
        wanted = await json_body(request)
        starred = wanted.get("starred") if isinstance(wanted, dict) else None
        if not isinstance(starred, bool):
            raise FormatError("starred must be true or false")
        library, flight_id = self._session.library, _flight_id(request)
        await asyncio.to_thread(library.star, flight_id, starred)
        return {"flight_id": flight_id, "starred": starred}

    async def pulses(self, request: Request) -> Any:
        """Some pulses as records: ``?after=0&limit=1000``."""
        after = whole_number(request, "after", 0, 2**31)
        limit = whole_number(request, "limit", 1000, 10_000)
        library, flight_id = self._session.library, _flight_id(request)
        return await asyncio.to_thread(library.records, flight_id, after, limit)

    async def columns(self, request: Request) -> Any:
        """All pulses in columns of little-endian float64; their names in a header.

        ``?names=tag_id,yaw_deg`` gives these alone.
        """
        library, flight_id = self._session.library, _flight_id(request)
        names = request.query_params.get("names")
        return await asyncio.to_thread(
            lambda: chosen_columns(library.pulses(flight_id), PULSE_COLUMNS, names)
        )

    async def track(self, request: Request) -> Any:
        """The vehicle's poses, likewise; ``?most=20000``: not more, evenly taken."""
        library, flight_id = self._session.library, _flight_id(request)
        names, most = (
            request.query_params.get("names"),
            whole_number(request, "most", 10**9, 10**9),
        )
        return await asyncio.to_thread(
            lambda: chosen_columns(thinned(library.poses(flight_id), most), POSE_COLUMNS, names)
        )

    async def estimates(self, request: Request) -> Any:
        """Bearings and positions of a flight, with the antenna that is set."""
        library, flight_id = self._session.library, _flight_id(request)
        antenna = self._session.vehicle.store.settings.antenna_choice
        summary = await asyncio.to_thread(library.summary, flight_id)
        key = (flight_id, summary.pulses, antenna)
        if key not in self._estimates:
            columns = await self._columns(request)
            estimator, place = Estimator(), library.path(flight_id)
            past = await asyncio.to_thread(estimator.past, place, antenna)
            self._estimates.clear()
            self._estimates[key] = await asyncio.to_thread(
                estimator.estimate, columns, antenna, (), summary.tags, (), past
            )
        return self._estimates[key].record()

    async def integrated(self, request: Request) -> Any:
        """What ``uavrt integrate`` has found in a flight's samples."""
        path = await asyncio.to_thread(self._session.library.path, _flight_id(request))
        return await asyncio.to_thread(integrated_record, path)

    async def integrate(self, request: Request) -> Any:
        """Look below the noise of a whole flight, or tell how far that is."""
        self._check_commander(request)
        path = await asyncio.to_thread(self._session.library.path, _flight_id(request))
        return await self._integration.answer(path, self._session.vehicle.store.settings.dem)

    async def folds(self, request: Request) -> Any:
        """Pictures of a flight folded at its tags' intervals."""
        path = await asyncio.to_thread(self._session.library.path, _flight_id(request))
        return await asyncio.to_thread(fold_pictures, path)

    async def silence(self, request: Request) -> Any:
        """The map of where a tag would have been heard, or how far it is."""
        path, antenna, wanted = await self._of_flight(request)
        asked = Silence.asked(path, antenna, wanted)
        return await asyncio.to_thread(self._silence.answer, asked, again=asks_again(wanted))

    async def absence(self, request: Request) -> Any:
        """How probable it is that a tag that was not heard is not in an outline."""
        path, antenna, wanted = await self._of_flight(request)
        asked = Silence.asked(path, antenna, wanted)
        return await asyncio.to_thread(self._silence.absence, asked, wanted)

    async def _of_flight(self, request: Request) -> tuple[Path, AntennaChoice, Any]:
        """A flight's directory, the antenna that is set, and what is wanted."""
        path = await asyncio.to_thread(self._session.library.path, _flight_id(request))
        return (
            path,
            self._session.vehicle.store.settings.antenna_choice,
            await json_body(request),
        )

    async def export(self, request: Request) -> Any:
        """A flight as a file for other programs."""
        flight_id, name = _flight_id(request), request.path_params["name"]
        if name not in EXPORTS:
            return Answer(404, {"error": f"there is no export {name[:40]!r}"})
        antenna = self._session.vehicle.store.settings.antenna_choice
        path = await asyncio.to_thread(self._session.library.path, flight_id)
        content = await asyncio.to_thread(export, name, path, antenna)
        return _download(content, f"{flight_id}.{name}", EXPORTS[name].media_type)

    async def report(self, request: Request) -> Any:
        """The report of a flight, for people."""
        library, antenna = (
            self._session.library,
            self._session.vehicle.store.settings.antenna_choice,
        )
        path = await asyncio.to_thread(library.path, _flight_id(request))
        content = await self._reporter.report(path, antenna)
        headers = {"Content-Security-Policy": POLICY}
        return Response(content, media_type="text/html", headers=headers)

    async def map_file(self, request: Request) -> Any:
        """A map file; the browser reads parts of it."""
        path = maps.map_path(
            self._session.vehicle.store.directory / "maps", request.path_params["name"]
        )
        return FileResponse(path, media_type="application/octet-stream")

    async def map_tile(self, request: Request) -> Any:
        """One tile of an MBTiles file."""
        place = request.path_params
        path = maps.map_path(self._session.vehicle.store.directory / "maps", place["name"])
        tile = await self._worker.call(maps.tile, path, place["z"], place["x"], place["y"])
        if tile is None:
            return Response(status_code=204)
        content, kind, encoding = tile
        headers = {"Content-Encoding": encoding} if encoding else {}
        return Response(content, media_type=kind, headers=headers)

    async def records(self, websocket: WebSocket) -> None:
        """Everything as it comes, after one record of the whole present state."""
        await websocket.accept()
        queue = self._session.vehicle.feed.hub.listen()
        page = websocket.query_params.get("page", "")[:MAX_PAGE_NAME]
        if page:
            self._session.commander.come(page)
        hello = {"topic": "hello", "record": self._session.hello()}
        listening = asyncio.create_task(_until_closed(websocket))
        try:
            await websocket.send_text(encode(hello).decode())
            async for text in _texts(queue, listening):
                await websocket.send_text(text)
            with contextlib.suppress(RuntimeError):
                await websocket.close(1001)
        except (WebSocketDisconnect, RuntimeError):
            pass  # the browser went away while we were sending
        finally:
            listening.cancel()
            self._session.vehicle.feed.hub.leave(queue)
            if page:
                self._session.commander.go(page)

    async def command_from_here(self, request: Request) -> Any:
        """Give command to the page that asks; the previous one becomes a viewer."""
        page = request.headers.get("x-page")
        if not page or len(page) > MAX_PAGE_NAME:
            raise UsageError("only a page can take command")
        self._session.commander.take(page)
        self._session.vehicle.feed.note(5, "another page has taken command")
        self._session.vehicle.feed.send_state()
        return {"commander": page}

    async def put_map(self, request: Request) -> Any:
        """Take a map file, as it is in the body."""
        folder = self._session.vehicle.store.directory / "maps"
        name = request.path_params["name"]
        return await maps.store_map(folder, name, request.stream(), self._worker)

    def _check_commander(self, request: Request) -> None:
        self._session.commander.check(request.headers.get("x-page"))

    async def _columns(self, request: Request) -> Columns:
        return await asyncio.to_thread(self._session.library.columns, _flight_id(request))


async def _texts(
    queue: asyncio.Queue[str | None], until: "asyncio.Task[None]"
) -> AsyncIterator[str]:
    """Texts of a queue until it ends or the task does."""
    while not until.done():
        getting = asyncio.ensure_future(queue.get())
        await asyncio.wait({getting, until}, return_when=asyncio.FIRST_COMPLETED)
        if not getting.done():
            getting.cancel()
            return
        text = getting.result()
        if text is None:
            return
        yield text


async def _until_closed(websocket: WebSocket) -> None:
    """Listeners say nothing; what they say is thrown away."""
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return


@dataclass(frozen=True, slots=True)
class Answer:
    """A value with a status other than 200."""

    status: int
    value: Any


def answered(handler: Callable[[Request], Awaitable[Any]]) -> Callable[[Request], Any]:
    """Turn values into JSON and deliberate errors into answers that say what to do."""

    async def answer(request: Request) -> Response:
        try:
            value = await handler(request)
        except (LinkError, CommandRefused) as error:
            return _json_response({"error": str(error)}, 409)
        except UavrtError as error:
            missing = error.message.startswith("there is no")
            return _json_response({"error": str(error)}, 404 if missing else 422)
        except OSError as error:
            named = "" if error.filename is None else f"{str(error.filename)[-80:]}: "
            return _json_response({"error": f"{named}{error.strerror or error}"}, 422)
        if isinstance(value, Response):
            return value
        if isinstance(value, Answer):
            return _json_response(value.value, value.status)
        return _json_response(value, 200)

    return answer


def _json_response(value: Any, status: int) -> Response:
    return Response(encode(value), status, media_type="application/json")


def _card_and_clock(drone_settings: Path) -> list[Finding]:
    """Look at the card of the drone's flights, which is in this computer, and at its clock."""
    from uavrt.computer.checks import check_card, check_kept_time

    settings = load_settings(drone_settings)
    directory = str(drone_settings.parent / settings.recording.directory)
    recording = replace(settings.recording, directory=directory)
    return [check_card(replace(settings, recording=recording)), check_kept_time()]


async def json_body(request: Request) -> Any:
    """Read what was sent as JSON; raises `FormatError`."""
    return read_body(await request.body())


def _place_records(places: Places) -> dict[str, Any]:
    home = places.home
    return {
        "home": home and {"latitude_deg": home[0], "longitude_deg": home[1]},
        "marks": [asdict(mark) for mark in places.marks],
    }


def _tag_answer(tags: tuple[Tag, ...]) -> dict[str, Any]:
    return {"tags": tag_table.rows_from_tags(tags), "version": tag_table.table_version(tags)}


def _flight_id(request: Request) -> str:
    return str(request.path_params["flight_id"])


def whole_number(request: Request, name: str, default: int, most: int) -> int:
    """Read a number of a query; raises `FormatError`."""
    text = request.query_params.get(name, str(default))
    if not text.isascii() or not text.isdigit():
        raise FormatError(f"{name} must be a whole number")
    return min(int(text[:12]), most)


def _download(content: bytes, name: str, kind: str) -> Response:
    # RFC 6266: headers are Latin; the name in full comes percent-encoded.
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "_" for c in name)
    disposition = f"attachment; filename=\"{plain}\"; filename*=UTF-8''{quote(name, safe='')}"
    return Response(content, media_type=kind, headers={"Content-Disposition": disposition})
