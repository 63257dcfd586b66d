"""The flights of a rehearsal: every order to its end, and every takeover at random instants."""

import asyncio
import math
import random
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from itertools import dropwhile
from pathlib import Path
from typing import Any

from uavrt.core.clock import monotonic_s
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.earth.geodesy import moved
from uavrt.core.errors import LinkError, UavrtError, UsageError
from uavrt.core.messages import PulsePose
from uavrt.core.units import s_from_ns, wrap_degrees_180
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.link.motions.motion_requests import (
    confirm,
    motion_request,
    request_motion,
    stop,
)
from uavrt_experiments.autopilots.builds import Build
from uavrt_experiments.autopilots.hand import CENTRED_US, HEIGHT_M
from uavrt_experiments.autopilots.measures import flying_of, heading_at, reaction
from uavrt_experiments.autopilots.scene import RunningScene, running
from uavrt_experiments.autopilots.takeovers import Takeover, takeovers_of
from uavrt_experiments.autopilots.tap import write_frames
from uavrt_experiments.kept import KeptOutcomes

WELL = ("done", "returning: the autopilot flies home")
"""Texts that report the planned end of an order, without a takeover; a note on a late link may
follow."""
ORDERS = ("takeoff", "survey", "goto", "rotate", "hold", "search", "return")
TAKEN = ("survey", "rotate", "goto")
"""Orders during which takeovers are flown."""
AFTERWARDS_S, SETTLES_S = 12.0, 8.0
STANDS_M_S = 0.15
LONGEST_S = {"search": 600.0, "survey": 420.0}
SEARCH_S = 120.0
FAR_M = 250.0
ASKS_S = 45.0
"""Longest wait for the drone to propose an order [s]; it needs a position and a home first."""
UNDER_WAY_S, TAKEN_AFTER_S, MOVES_M_S = 60.0, (1.5, 10.0), 1.0
"""Longest wait for an order to begin [s]; range of the random time from there to its takeover
[s]; least speed at a takeover that only the stop reveals [m/s]."""
TRIES = 4
"""Maximum number of attempts at a takeover; each further one has another random start, since
the order ended before the takeover."""


class _NotTakenError(UavrtError):
    """The order had ended before the takeover."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Requested number of flights of each kind."""

    surveys: int = 20
    searches: int = 10
    takeoffs: int = 20
    others: int = 10
    phases: int = 5
    """Number of random instants at which each takeover is flown."""
    only: str = ""
    """Text that the names of the flights must contain; empty for all."""
    seed: int = 1

    def times(self, order: str) -> int:
        """Number of flights of an order."""
        named = {"survey": self.surveys, "search": self.searches, "takeoff": self.takeoffs}
        return named.get(order, self.others)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A planned flight: one order, with or without a takeover."""

    build: Build
    order: str
    number: int
    seed: int
    takeover: Takeover | None = None

    @property
    def name(self) -> str:
        """Unique name of the flight and its files."""
        what = self.order if self.takeover is None else f"taken over, {self.takeover.name}"
        return f"{self.build.name}, {what}, {self.number}"


def planned(builds: list[Build], asked: Asked) -> Iterator[Flight]:
    """List the flights: one of each kind, then the second of each kind, and so on."""
    for build in builds:
        everything: list[tuple[str, Takeover | None, int]] = [
            (order, None, number) for order in ORDERS for number in range(asked.times(order))
        ]
        everything += [
            ("", one, number)
            for one in takeovers_of(build.flavour)
            if not (build.simulated and one.real_only)
            for number in range(asked.phases)
        ]
        for order, takeover, number in sorted(everything, key=lambda one: one[2]):
            seed = asked.seed * 1000 + number
            rng = random.Random(f"{seed} {takeover and takeover.name}")
            flight = Flight(
                build=build,
                order=order or rng.choice(TAKEN),
                number=number,
                seed=seed,
                takeover=takeover,
            )
            if asked.only in flight.name:
                yield flight


def rehearse(
    builds: list[Build],
    asked: Asked,
    frames: Path,
    kept: KeptOutcomes,
    failed: list[dict[str, Any]],
    say: Callable[[str], None],
) -> None:
    """Fly the flights that `kept` does not have yet; each result is stored at once.

    Ctrl-C therefore loses no finished flight.

    `frames`: directory for the frames of each flight.
    `failed`: receives the flights that were not flown to their end; they are repeated next
    time.
    `say`: receives a line of progress.
    Raises `UsageError`: no flight is requested.
    Raises `UavrtError`: an autopilot does not start, or four times does not restart.
    """
    if not any(planned(builds, asked)):
        raise UsageError(
            f'no flight with "{asked.only}" in its name is requested',
            remedy='Choose others, such as --only survey or --only "mode: land"',
        )
    for build in builds:
        flights = [one for one in planned([build], asked) if one.name not in kept]
        begun, failures = len(flights), 0
        while flights:
            with tempfile.TemporaryDirectory(prefix="uavrt-autopilots-") as work:
                try:
                    asyncio.run(_session(build, flights, Path(work), frames, kept, failed, say))
                except UavrtError as error:
                    failures += 1
                    if len(flights) == begun or failures == TRIES:
                        raise
                    say(f"{build.name} is started again: {error}")


async def _session(
    build: Build,
    flights: list[Flight],
    work: Path,
    frames: Path,
    kept: KeptOutcomes,
    failed: list[dict[str, Any]],
    say: Callable[[str], None],
) -> None:
    """Fly flights from the list until the autopilot must be restarted."""
    first = flights[0]
    async with running(build, work, first.seed, frames / first.name, say) as scene:
        while flights:
            flight = flights.pop(0)
            begun_s = monotonic_s()
            try:
                outcome = await _tried(scene, flight, frames)
            except UavrtError as error:
                outcome = {"failed": str(error)}
            outcome |= {"build": build.name, "order": flight.order}
            outcome["takeover"] = flight.takeover and flight.takeover.name
            if "failed" in outcome:
                failed.append(outcome)
            else:
                kept.take(flight.name, partial(dict, outcome))
            ended = outcome.get("failed") or outcome["ended"]
            say(f"{flight.name}: {ended} ({monotonic_s() - begun_s:.0f} s)")
            if "failed" in outcome or (flight.takeover and flight.takeover.restarts):
                break


async def _tried(scene: RunningScene, flight: Flight, frames: Path) -> dict[str, Any]:
    """Fly one flight; repeat it if the order ended before the takeover."""
    for attempt in range(TRIES):
        try:
            return await _Rehearsed(scene, flight, frames, attempt).flown()
        except _NotTakenError:
            if attempt == TRIES - 1 or (flight.takeover and flight.takeover.restarts):
                raise
    raise AssertionError


class _Rehearsed:
    def __init__(self, scene: RunningScene, flight: Flight, frames: Path, attempt: int) -> None:
        self._scene, self._flight, self._frames = scene, flight, frames
        self._rng = random.Random(f"{flight.name} {flight.seed} {attempt}")
        self._directory = ""

    async def flown(self) -> dict[str, Any]:
        scene, flight = self._scene, self._flight
        scene.check()
        hand, order = scene.hand, flight.order
        switches = flight.takeover is not None and flight.takeover.sticks
        hand.channels_us = CENTRED_US if switches else ()
        if order == "takeoff":
            await hand.stand()
            await asyncio.sleep(2.0)
            await hand.arm()
        else:
            await hand.hover()
            if hand.away_m(scene.home) > FAR_M or abs(hand.height_m - HEIGHT_M) > 8.0:
                await hand.come_back(scene.home)
        if order == "search":
            await scene.link.upload_tags(scene.scenario.tags)
            self._directory = await scene.link.start_detection()
        scene.companion.kept.clear()
        scene.companion.latest_s = 0.0
        hand.heading.clear()
        scene.pulses.clear()
        try:
            outcome = await self._ordered()
        finally:
            write_frames(self._frames / f"{flight.name}.tlog", scene.companion.kept)
        if order == "search":
            outcome |= await self._listened()
        await self._left()
        if flight.takeover is not None and has_arrived(outcome["ended"]):
            raise _NotTakenError("the order ended as planned after its takeover")
        return outcome

    async def _ordered(self) -> dict[str, Any]:
        """Request an order, confirm it, and follow it to its end."""
        scene, flight = self._scene, self._flight
        offer = await self._offer()
        scene.states.clear()
        await confirm(scene.link, offer, sticks_unseen=True)
        confirmed_s, taken_s = scene.now_s, None
        takeover = flight.takeover
        if takeover is not None:
            taken_s, shows = await self._taken_over(takeover)
        out_s = await self._out(confirmed_s, taken_s)
        await asyncio.sleep(SETTLES_S if takeover is None else AFTERWARDS_S)
        if takeover is not None:
            takeover.undo(scene)
        kept = list(scene.companion.kept)
        ending = next((one.text for at, one in scene.states if at == out_s), "not ended")
        outcome: dict[str, Any] = {
            "ended": ending,
            "duration_s": (out_s or scene.now_s) - confirmed_s,
            "arrived": takeover is None and has_arrived(ending),
            "flying": asdict(flying_of(kept, taken_s or math.inf)),
            "relay_late_s": scene.companion.latest_s,
        }
        if takeover is not None and taken_s is not None:
            stood_s = self._stood_s if takeover.stops else None
            outcome["out_s"] = None if out_s is None else out_s - (stood_s or taken_s)
            shown = reaction(kept, taken_s, out_s, shows)
            if shows is not None and shown.shown_s is None and out_s is None:
                raise _NotTakenError("the takeover had no effect, such as a fence not reached")
            outcome["reaction"] = asdict(shown)
        return outcome

    async def _offer(self) -> Any:
        """Repeat the request until the drone offers the order."""
        deadline_s = monotonic_s() + ASKS_S
        while True:
            try:
                return await request_motion(self._scene.link, self._request())
            except UavrtError:
                if monotonic_s() > deadline_s:
                    raise
                await asyncio.sleep(1.0)

    def _request(self) -> Any:
        rng, scene, order = self._rng, self._scene, self._flight.order
        here = scene.hand.place
        if order == "takeoff":
            return motion_request("takeoff", height_m=rng.uniform(25.0, 45.0))
        if order == "goto":
            near_m = 10.0 if self._flight.takeover is None else 80.0
            off = rng.uniform(near_m, 120.0), rng.uniform(0.0, 360.0)
            return motion_request("goto", [_away(here, *off)], height_m=HEIGHT_M)
        if order == "rotate":
            return motion_request("rotate", duration_s=rng.uniform(25.0, 45.0))
        if order == "search":
            return motion_request(
                "search", radius_m=260.0, duration_s=SEARCH_S, height_m=HEIGHT_M
            )
        if order == "survey":
            length, wide = math.exp(rng.uniform(math.log(12.0), math.log(150.0))), 30.0
            turn = rng.uniform(0.0, 360.0)
            first = _away(here, rng.uniform(5.0, 40.0), rng.uniform(0.0, 360.0))
            second = _away(first, length, turn)
            corners = [first, second, _away(second, wide, turn + 90.0)]
            corners.append(_away(first, wide, turn + 90.0))
            height_m = rng.uniform(30.0, 60.0)
            return motion_request("survey", corners, spacing_m=25.0, height_m=height_m)
        return motion_request(order)

    async def _taken_over(self, takeover: Takeover) -> tuple[float, Any]:
        """Wait until the order is under way, then act."""
        scene = self._scene
        deadline_s, begun_s = monotonic_s() + UNDER_WAY_S, math.inf
        after_s = self._rng.uniform(*TAKEN_AFTER_S)
        while True:
            now_s = monotonic_s()
            if self._ended is not None or now_s > deadline_s:
                raise _NotTakenError("the order ended, or did not begin, before its takeover")
            if scene.standing == "in command":
                begun_s = min(begun_s, now_s)
            moves = not takeover.stops or scene.hand.speed_m_s > MOVES_M_S
            if now_s > begun_s + after_s and moves:
                break
            await asyncio.sleep(0.02)
        shows = None if takeover.shows is None else takeover.shows(scene.hand)
        taken_s = scene.now_s
        await asyncio.to_thread(takeover.act, scene)
        return taken_s, shows

    @property
    def _ended(self) -> float | None:
        """Time [s] at which the drone reported the end of the order."""
        states = list(dropwhile(lambda one: one[1].standing == "out", self._scene.states))
        return next((at for at, one in states if one.standing == "out"), None)

    async def _out(self, confirmed_s: float, taken_s: float | None) -> float | None:
        scene, self._stood_s = self._scene, None
        longest_s = LONGEST_S.get(self._flight.order, 180.0)
        if taken_s is not None:
            longest_s = taken_s - confirmed_s + 25.0
        while self._ended is None and scene.now_s - confirmed_s < longest_s:
            scene.check()
            stands = taken_s is not None and scene.hand.speed_m_s < STANDS_M_S
            if stands and self._stood_s is None:
                self._stood_s = scene.now_s
            await asyncio.sleep(0.05)
        return self._ended

    async def _listened(self) -> dict[str, Any]:
        """Compare the drone's pulses with the ground's, and their headings with the pilot's
        record.
        """
        scene = self._scene
        await scene.link.stop_detection()
        await asyncio.sleep(3.0)
        sent = set(map(_name_of, read_flight(Path(self._directory)).pulse_poses))
        got = set(map(_name_of, scene.pulses))
        arrived = sum(any((tag, ms + off) in got for off in (-1, 0, 1)) for tag, ms in sent)
        errors = []
        for one in scene.pulses:
            if one.pose is None:
                continue
            truth = heading_at(scene.hand.heading, s_from_ns(one.pose.time_ns))
            if truth is not None:
                heading_deg = yaw_deg(one.pose.quaternion_wxyz)
                errors.append(wrap_degrees_180(heading_deg - truth))
        return {"pulses": [arrived, len(sent)], "yaw_errors_deg": errors}

    async def _left(self) -> None:
        """End the order, so that the drone hovers."""
        scene, takeover = self._scene, self._flight.takeover
        if takeover is not None and takeover.restarts:
            return
        hand = scene.hand
        if scene.standing != "out":
            try:
                await stop(scene.link)
            except LinkError:
                scene.check()
        if hand.armed and not hand.on_ground:
            hand.name_mode("hold")
            await asyncio.sleep(1.0)
            hand.go_to(0.0, 0.0)
            await asyncio.sleep(3.0)


def has_arrived(ended: str) -> bool:
    """True if the drone reported that the order ended by its arrival."""
    return ended.startswith(WELL)


def _name_of(one: PulsePose) -> tuple[int, int]:
    """Tag and start [ms] that identify a pulse; the tunnel rounds times to floating-point
    seconds.
    """
    return one.pulse.tag_id, round(1e3 * s_from_ns(one.pulse.start_time_ns))


def _away(place: tuple[float, float], distance_m: float, way_deg: float) -> tuple[float, float]:
    return moved(
        *place,
        HEIGHT_M,
        north_m=distance_m * math.cos(math.radians(way_deg)),
        east_m=distance_m * math.sin(math.radians(way_deg)),
    )
