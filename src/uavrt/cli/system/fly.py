"""``uavrt fly``: move the drone; each motion is confirmed by a person."""

import asyncio
import json
import signal
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from uavrt.cli.options.kinds import Component, Metres, Minutes, Seconds
from uavrt.config.text_files import read_text
from uavrt.core.clock import Clock
from uavrt.core.errors import ConfigError, FormatError, LinkError, UavrtError, os_errors_as
from uavrt.core.foreign import SHAPES
from uavrt.core.messages import KeepOut, MotionRequest, SurveyPattern
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.keys import LinkKeys, read_link_keys
from uavrt.ground.link.motions.motion_requests import (
    confirm,
    motion_request,
    request_motion,
    stop,
)
from uavrt.ground.link.protocol import GroundEvent
from uavrt.guidance.files.area_text import area_in, keep_out_in
from uavrt.guidance.files.mission import NOT_CHECKED, NOT_CHECKED_ABOARD, survey_items
from uavrt.guidance.files.plan_file import fence_file, survey_file
from uavrt.guidance.operator_orders import Limits, Order
from uavrt.guidance.safety import SAFETY
from uavrt.link.mavlink.autopilot.waiting import within
from uavrt.link.tunnel.own_messages.motion_messages import MotionState

DEFAULT_ADDRESS = "udpin://127.0.0.1:14550"
WORD = "fly"
DRONE_WAIT_S = 10.0
SESSION_WAIT_S = 5.0
SPEED_M_S = 5.0
"""Flight speed written into a saved plan [m/s]; QGroundControl can change it."""
Flag = Annotated[bool, Parameter(negative="")]
Places = tuple[tuple[float, float], ...]


def fly(
    action: Literal[
        "rotate",
        "goto",
        "survey",
        "search",
        "hold",
        "return",
        "takeoff",
        "stop",
        "status",
        "fence",
    ],
    /,
    *numbers: float,
    area: Path | None = None,
    keep_out: Path | None = None,
    height: Metres | None = None,
    seconds: Seconds = 60.0,
    left: Flag = False,
    spacing: Metres = 60.0,
    pattern: SurveyPattern = "lines",
    radius: Metres | None = None,
    tags: str | None = None,
    accuracy: Metres = 25.0,
    minutes: Minutes = 15.0,
    sticks_unseen: Flag = False,
    save: Path | None = None,
    upload: Flag = False,
    farthest: Metres = 500.0,
    mavlink: str = DEFAULT_ADDRESS,
    command_key: Path | None = None,
    signing_key: Path | None = None,
    component_id: Component = 190,
    yes: Flag = False,
    json_lines: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Move the drone, or end uavrt's control of it.

    The drone first proposes a motion or gives a refusal; it moves only after you type the
    word "fly". Then progress is shown until the end. A pilot ends the motion with a switch, a
    stick or another ground station; Ctrl-C here and "stop" from anywhere end it, too. uavrt
    never arms: a pilot arms, and also takes off unless guidance.may_take_off is set on the
    drone.

    Parameters
    ----------
    action
        rotate: turn once in place; goto LATITUDE LONGITUDE; survey: lines over an area;
        search: find tags on a path that the drone chooses, then return; hold: stay here;
        return: fly home by the autopilot; takeoff HEIGHT: climb from the ground to this height
        above home [m], once a pilot has armed; stop: stand still and accept no more commands;
        status: show who controls the drone; fence: show the autopilot's fence.
    numbers
        goto: latitude and longitude [deg], after "--" if one is negative; takeoff: the height.
    area
        Outline of a survey or a search: GeoJSON, KML, or a .plan of QGroundControl; at most 20
        corners, of a search 19, and one less for every two tags that are named. Outlines in it
        that are marked "keep out" are not flown over; their corners count, too.
    keep_out
        File with areas that are not flown over, such as people and buildings, in the same
        formats; those of the drone's guidance.keep_out_file are added.
    height
        Height above home [m]; by default the present one.
    seconds
        Duration of a full turn.
    left
        Turn to the left.
    spacing
        Distance between the lines of a survey, or its points [m].
    pattern
        Pattern of a survey: lines over the area; around, along the outline; points in it, with
        a full turn at each.
    radius
        Search within this radius [m] of the drone, in place of --area.
    tags
        Numbers of the tags to search for, like 2,4; by default all that are listed.
    accuracy
        A tag counts as found when it is within this radius [m] with 95 % probability.
    minutes
        Longest duration of a search: the drone returns then, or once all tags are found.
    sticks_unseen
        Confirm that you know that the drone has no RC link.
    save
        Write a survey as a .plan for QGroundControl instead, which a pilot uploads and starts;
        no drone is needed. With "fence": write the fence to this file.
    upload
        Upload a survey to the autopilot as its mission, in place of the present one, and read
        it back. Only a pilot can start it. While the vehicle flies a mission, nothing is
        uploaded. Fence and home are read first: a survey that leaves the fence, or whose
        return would leave it, is refused.
    farthest
        Greatest distance from home that a survey to upload may reach [m].
    mavlink
        Link to the vehicle, as for `uavrt ground`.
    command_key
        Key file that the drone has as mavlink.key_file. Without it only the simulator moves.
    signing_key
        Key file that the drone has as mavlink.signing_key_file.
    component_id
        Our MAVLink component id in system 254.
    yes
        Skip the confirmation (for scripts). Only without a key, that is, with the simulator.
    json_lines
        Print JSON lines instead of text.
    """
    if yes and command_key is not None:
        raise ConfigError(
            "--yes cannot be used with a key: a person must confirm the motion of a real drone",
            remedy="Leave --yes out; it is meant for the simulator, which needs no key",
        )
    keys = read_link_keys(command_key, signing_key, component_id)
    if action == "fence":
        _check_plan_name(save, "fence")
        sys.exit(asyncio.run(_fence(mavlink, keys, save, json_lines=json_lines)))
    request = None
    if action != "stop" and action != "status":
        request = motion_request(
            action,
            _places(action, numbers, area),
            height_m=_height(action, numbers, height),
            duration_s=60.0 * minutes if action == "search" else seconds,
            clockwise=not left,
            spacing_m=spacing,
            pattern=pattern,
            tags=_numbers(tags),
            radius_m=radius,
            accuracy_m=accuracy,
            keep_out=_keep_out(area, keep_out),
        )
        _check_search(action, request)
    if save is not None:
        _save(save, request)
    if upload:
        order = _survey(request, "uploaded")
        limits = Limits(fence_m=farthest)
        sys.exit(asyncio.run(_upload(mavlink, keys, order, limits, json_lines=json_lines)))
    if save is not None:
        return
    terminal = _Terminal(keys, json_lines=json_lines, yes=yes, sticks_unseen=sticks_unseen)
    sys.exit(asyncio.run(terminal.run(mavlink, action, request)))


def _height(action: str, numbers: tuple[float, ...], height: float | None) -> float | None:
    if action != "takeoff":
        return height
    if len(numbers) != 1 or height is not None:
        raise ConfigError("takeoff needs one height", remedy="Run: uavrt fly takeoff HEIGHT")
    return numbers[0]


def _places(action: str, numbers: tuple[float, ...], area: Path | None) -> Places:
    place = ((numbers[0], numbers[1]),) if len(numbers) == 2 else ()
    for north, east in place if action == "goto" else ():
        if not abs(north) <= 90.0:
            raise ConfigError(
                f"{north:g} is not a latitude",
                remedy="Give a latitude from -90 to 90, then the longitude",
            )
        if not abs(east) <= 180.0:
            raise ConfigError(
                f"{east:g} is not a longitude", remedy="Give a longitude from -180 to 180"
            )
    if action == "goto" and not place:
        raise ConfigError(
            "goto needs a position", remedy="Run: uavrt fly goto LATITUDE LONGITUDE"
        )
    if numbers and action not in ("goto", "takeoff"):
        raise ConfigError(
            f"{action} accepts no numbers",
            remedy="Give numbers only to goto and takeoff; see `uavrt fly --help`",
        )
    if action != "search" and (area is not None) != (action == "survey"):
        raise ConfigError(
            f"{action} {'needs an' if action == 'survey' else 'accepts no'} area",
            remedy="Give an area to a survey or a search, for example: "
            "uavrt fly survey --area FILE.geojson (or .kml, .plan)",
        )
    if area is not None:
        return area_in(_text_of(area), str(area))
    return place


def _keep_out(area: Path | None, keep_out: Path | None) -> tuple[KeepOut, ...]:
    """Areas that must not be flown over.

    They are the areas marked "keep out" in the area's file and all areas in the keep-out file.
    """
    marked = () if area is None else keep_out_in(_text_of(area), str(area))
    if keep_out is None:
        return marked
    return (*marked, *keep_out_in(_text_of(keep_out), str(keep_out), every=True))


def _numbers(text: str | None) -> tuple[int, ...]:
    try:
        return () if text is None else tuple(map(int, text.replace(",", " ").split()))
    except ValueError:
        raise ConfigError(
            f"{text!r} is not a list of tag numbers",
            remedy="Give numbers separated by commas, such as 2,4",
        ) from None


def _check_search(action: str, request: MotionRequest) -> None:
    """Raise `ConfigError` for search options with other motions, or not exactly one area."""
    if action != "search":
        if request.tags or request.radius_m is not None:
            raise ConfigError(
                f"{action} accepts neither tags nor a radius",
                remedy="Give them only to a search: uavrt fly search --radius 300",
            )
    elif bool(request.places) == (request.radius_m is not None):
        raise ConfigError(
            "a search needs exactly one area",
            remedy="Give --area FILE.geojson, or --radius 300 for a circle around the drone",
        )


def _survey(request: MotionRequest | None, use: str) -> Order:
    """Return the command for the requested survey; raises `ConfigError` for other motions."""
    if request is None or request.action != "survey":
        raise ConfigError(
            f"only a survey can be {use}",
            remedy="Run: uavrt fly survey --area FILE --height 60",
        )
    return Order.of(request)


def _check_plan_name(path: Path | None, what: str) -> None:
    if path is not None and path.suffix != ".plan":
        raise ConfigError(
            f"a {what} can be saved only as a .plan file",
            remedy=f"Run: uavrt fly {what} --save FILE.plan",
        )


def _save(path: Path, request: MotionRequest | None) -> None:
    order = _survey(request, "saved as a .plan file")
    _check_plan_name(path, "survey")
    _write(path, survey_file(order, SPEED_M_S))
    print(f"{path}: open it in QGroundControl, upload it, and start it when the drone hovers")
    print(f"not checked: {NOT_CHECKED}")


def _write(path: Path, text: str) -> None:
    fault = f"{path} cannot be written"
    with (
        os_errors_as(FormatError, fault, "Choose another name"),
        path.open("x", encoding="utf-8") as file,
    ):
        file.write(text)


async def _upload(
    address: str, keys: LinkKeys, order: Order, limits: Limits, *, json_lines: bool
) -> int:
    survey_items(order, limits)
    async with _connected(address, keys) as link:
        done = await link.missions.upload_survey(order, limits)
    text = (
        f"the vehicle has the survey: {done.items} items, read back. It stays within the "
        f"vehicle's fence; not checked: {NOT_CHECKED_ABOARD}. A pilot starts it when the drone "
        "hovers; uavrt does not watch over that flight"
    )
    _print("uploaded", text, json_lines=json_lines)
    return 0


async def _fence(address: str, keys: LinkKeys, save: Path | None, *, json_lines: bool) -> int:
    """Show the autopilot's fence, and write it to `save` if given; return exit status 0."""
    async with _connected(address, keys) as link:
        fence = await link.missions.fence()
    text = (
        f"the vehicle's fence: areas to stay within: {len(fence.within)}, "
        f"to keep out of: {len(fence.keep_out)}"
    )
    if save is not None:
        _write(save, fence_file(fence))
        text += f"; {save}"
    _print("fence", text, json_lines=json_lines)
    return 0


@asynccontextmanager
async def _connected(address: str, keys: LinkKeys) -> AsyncIterator[GroundLink]:
    link = _link(keys, lambda event: None)
    serve = asyncio.create_task(link.run(address))
    wait = asyncio.create_task(link.missions.wait(DRONE_WAIT_S))
    try:
        await asyncio.wait({serve, wait}, return_when=asyncio.FIRST_COMPLETED)
        if serve.done():
            serve.result()
        await wait
        yield link
    finally:
        for task in (wait, serve):
            task.cancel()
            with suppress(asyncio.CancelledError, UavrtError):
                await task


def _link(keys: LinkKeys, take: Callable[[GroundEvent], None]) -> GroundLink:
    return GroundLink(
        Clock.start().now_ns,
        on_event=take,
        component_id=keys.component_id,
        key=keys.command,
        signing_key=keys.signing,
    )


def _print(what: str, text: str, *, json_lines: bool) -> None:
    print(
        json.dumps({"event": what, "text": text}) if json_lines else f"{what}: {text}",
        flush=True,
    )


def _text_of(path: Path) -> str:
    return read_text(path, SHAPES)


def forget_typed_ahead() -> None:
    """Discard lines typed before the drone's proposal, so that they cannot confirm it."""
    with suppress(ImportError, OSError):
        import termios  # not on Windows

        termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)


class _Terminal:
    def __init__(
        self, keys: LinkKeys, *, json_lines: bool, yes: bool, sticks_unseen: bool
    ) -> None:
        self._keys, self._json, self._yes = keys, json_lines, yes
        self._sticks_unseen = sticks_unseen
        self._states: asyncio.Queue[MotionState] = asyncio.Queue()
        self._shown = ("", "")
        self._stopping = asyncio.Event()

    async def run(self, address: str, action: str, request: MotionRequest | None) -> int:
        link = _link(self._keys, self._take)
        serve = asyncio.create_task(link.run(address))
        work = asyncio.create_task(self._work(link, action, request))
        try:
            await asyncio.wait({serve, work}, return_when=asyncio.FIRST_COMPLETED)
            if serve.done():
                serve.result()
            return await work
        finally:
            for task in (work, serve):
                task.cancel()
                with suppress(asyncio.CancelledError, UavrtError):
                    await task

    async def _work(self, link: GroundLink, action: str, request: MotionRequest | None) -> int:
        await link.wait_for_drone(DRONE_WAIT_S)
        if action == "status":
            return await self._status()
        if request is None:
            self._show(await stop(link))
            return 0
        offer = await request_motion(link, request)
        self._say("offer", offer.text)
        if not await self._agreed():
            self._say("cancelled", "nothing was confirmed, nothing moves")
            return 1
        loop = asyncio.get_running_loop()
        for signal_number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(signal_number, self._stopping.set)
        self._show(await confirm(link, offer, sticks_unseen=self._sticks_unseen))
        return await self._follow(link, offer.order_id)

    async def _status(self) -> int:
        state = await within(SESSION_WAIT_S, self._states.get())
        if state is None:
            raise LinkError(
                "the drone does not report the state of its motion",
                remedy="Set guidance.enabled = true in its uavrt.toml",
            )
        self._show(state)
        return 0

    async def _agreed(self) -> bool:
        if self._yes:
            return True
        if not sys.stdin.isatty():
            raise ConfigError(
                "the order cannot be confirmed, because standard input is not a terminal",
                remedy='Run the command in a terminal, and type "fly" there',
            )
        prompt = (
            f'Type "{WORD}" within {SAFETY.offer_holds_s:.0f} s to confirm, '
            "anything else to leave it: "
        )
        forget_typed_ahead()
        try:
            return (await asyncio.to_thread(input, prompt)).strip() == WORD
        except EOFError:
            return False

    async def _follow(self, link: GroundLink, order_id: int) -> int:
        """Print an order's progress until it ends; return the exit status, 0 if completed."""
        while True:
            state = asyncio.create_task(self._states.get())
            stopping = asyncio.create_task(self._stopping.wait())
            done, _ = await asyncio.wait({state, stopping}, return_when=asyncio.FIRST_COMPLETED)
            for task in {state, stopping} - done:
                task.cancel()
            if stopping in done:
                self._show(await stop(link))
                return 130
            if state.result().order_id != order_id:
                if state.result().standing == "out":
                    continue
                self._say("out", "another order was confirmed")
                return 1
            self._show(state.result())
            if state.result().standing == "out":
                text = state.result().text
                return 0 if text == "done" or text.startswith("returning") else 1

    def _take(self, event: GroundEvent) -> None:
        if isinstance(event, MotionState) and event.kind == "state":
            self._states.put_nowait(event)

    def _show(self, state: MotionState) -> None:
        if self._shown != (state.standing, state.text):
            self._shown = (state.standing, state.text)
            self._say(state.standing, state.text)

    def _say(self, what: str, text: str) -> None:
        _print(what, text, json_lines=self._json)
