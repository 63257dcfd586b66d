"""Rehearsals on autopilots: what is flown, what frames show, and what the table says."""

import json
import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from uavrt.core.errors import UavrtError, UsageError
from uavrt.guidance.control.vehicle_commands import VehicleCommand
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import command_message
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.simulation.scene.geometry import TangentPlane
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES, FlyingVehicle
from uavrt.simulation.vehicle.vehicle_telemetry import position_message
from uavrt_experiments.autopilots import flights as flown_flights
from uavrt_experiments.autopilots.builds import arducopter_build, px4_build, simulated_build
from uavrt_experiments.autopilots.flights import (
    ORDERS,
    TRIES,
    Asked,
    has_arrived,
    planned,
    rehearse,
)
from uavrt_experiments.autopilots.hand import Foreign, Hand
from uavrt_experiments.autopilots.measures import flying_of, heading_at, reaction
from uavrt_experiments.autopilots.table import as_json, as_page, compared, flavour_of
from uavrt_experiments.autopilots.takeovers import takeovers_of
from uavrt_experiments.autopilots.tap import Kept, read_frames, write_frames
from uavrt_experiments.kept import KeptOutcomes

HOME = TangentPlane(latitude_deg=47.1, longitude_deg=8.5, altitude_amsl_m=430.0)
STEP_S = 0.02
START_S = 1_000.0


class Link:
    """A companion link in virtual time, with a vehicle that flies what is commanded."""

    def __init__(self, flavour: Flavour) -> None:
        frame = Frame(gust_m=0.0, speed_m_s=5.0)
        self.vehicle = FlyingVehicle(flavour, HOME, frame, height_m=40.0)
        self.vehicle.set_mode(MODES[flavour]["hold"])
        self.kept: list[Kept] = []
        self.time_s = START_S
        self._writers = {1: FrameWriter(1, 1), 191: FrameWriter(1, 191)}

    def tell(self, component: int, message: Message) -> None:
        (frame,) = FrameParser().feed(self._writers[component].encode(message))
        self.kept.append(Kept(self.time_s, frame))

    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.time_s += STEP_S
            self.vehicle.advance(STEP_S)
            self.tell(1, position_message(self.vehicle, round(1e3 * self.time_s)))

    def go(self, north_m: float, east_m: float, yaw: float = math.nan) -> None:
        latitude, longitude = HOME.to_geodetic(north_m, east_m)
        command = VehicleCommand(
            name="DO_REPOSITION",
            param1=-1.0,
            param2=1.0,
            param4=yaw,
            x=round(latitude * 1e7),
            y=round(longitude * 1e7),
            z_m=470.0,
        )
        message: Any = command_message(command, 1)
        self.tell(191, message)
        self.vehicle.command(message)


# ------------------------------------------------------------------------- the frames


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_the_frames_of_a_leg_show_how_it_was_flown(flavour: Flavour) -> None:
    link = Link(flavour)
    link.fly(1.0)
    link.go(-40.0, 5.0)
    link.fly(30.0)
    flown = flying_of(link.kept)
    assert 0.1 < flown.begins_s[0] < 2.5
    assert 0.0 <= flown.overshoot_m[0] < 2.0
    assert 0.5 < flown.settling_s[0] < 9.4
    turning_deg_s = {"px4": (30.0, 75.0), "ardupilot": (110.0, 180.0)}[flavour]
    assert turning_deg_s[0] < flown.turn_rate_deg_s[0] < turning_deg_s[1]
    assert abs(flown.height_error_m[0]) < 0.1


def test_an_overshoot_is_the_way_beyond_the_target() -> None:
    link = Link("px4")
    link.fly(0.5)
    link.go(30.0, 0.0)
    for step in range(600):
        link.time_s += STEP_S
        north_m = min(33.0, 0.1 * step) if step < 450 else 30.0
        link.vehicle.body.north_m = north_m
        link.tell(1, position_message(link.vehicle, step))
    flown = flying_of(link.kept)
    assert flown.overshoot_m == pytest.approx([3.0], abs=0.05)
    assert flown.settling_s == pytest.approx([(449 - 270) * STEP_S], abs=0.1)


def test_a_leg_that_is_cut_short_shows_no_arrival() -> None:
    link = Link("px4")
    link.go(60.0, 0.0)
    link.fly(5.0)
    link.go(60.0, 60.0)
    link.fly(3.0)
    flown = flying_of(link.kept)
    assert flown.overshoot_m == flown.settling_s == ()
    assert len(flown.begins_s) == 2


def test_nothing_after_a_takeover_counts_as_our_flight() -> None:
    link = Link("px4")
    link.go(20.0, 0.0)
    link.fly(2.0)
    taken_s = link.time_s
    link.fly(20.0)
    assert flying_of(link.kept).overshoot_m
    assert not flying_of(link.kept, taken_s).overshoot_m


def test_frames_survive_their_file_and_a_torn_end(tmp_path: Path) -> None:
    link = Link("ardupilot")
    link.go(20.0, 0.0)
    link.fly(0.2)
    path = tmp_path / "flight.tlog"
    write_frames(path, link.kept)
    again = read_frames(path)
    assert [one.frame.raw for one in again] == [one.frame.raw for one in link.kept]
    assert [one.time_s for one in again] == pytest.approx([one.time_s for one in link.kept])
    assert again[0].ours
    assert not again[1].ours
    path.write_bytes(path.read_bytes()[:-5])
    assert len(read_frames(path)) == len(link.kept) - 1


@pytest.mark.parametrize(
    ("wanted", "time_s"), [(None, 0.5), (358.0, 1.02), (-2.0, 1.06), (None, 1.5), (None, 9.0)]
)
def test_headings_are_taken_between_two_that_are_near(
    wanted: float | None, time_s: float
) -> None:
    heading = [(1.0, -3.0), (1.1, 2.0), (2.0, 3.0)]
    if wanted is not None:
        wanted = -3.0 + 50.0 * (time_s - 1.0)
    found = heading_at(heading, time_s)
    assert (found is None) == (wanted is None)
    assert wanted is None or found == pytest.approx(wanted)


# ---------------------------------------------------------------------- the takeovers


def shows_land(message: Message) -> bool:
    return isinstance(message, dialect.CurrentMode) and message.custom_mode == 9


def taken_over(*after_s: float) -> tuple[list[Kept], float]:
    """Commands so long after a takeover that shows after 0.1 s."""
    link = Link("px4")
    link.go(20.0, 0.0)
    link.fly(3.0)
    taken_s = link.time_s
    for at_s, what in sorted([(0.1, "mode"), *((one, "command") for one in after_s)]):
        link.time_s = taken_s + at_s
        if what == "command":
            link.go(30.0, 0.0)
        else:
            link.tell(1, dialect.CurrentMode(custom_mode=9, intended_custom_mode=9))
    return link.kept, taken_s


@pytest.mark.parametrize(
    ("after_s", "ended_s", "shows", "commands", "last_s"),
    [
        ((0.05,), 0.15, shows_land, (0, 1), -0.05),
        ((0.05, 0.13, 4.0), 5.0, shows_land, (2, 1), 3.9),
        ((0.05, 0.09), 0.07, shows_land, (1, 1), 0.02),
        # Without a revealing message the end of the order counts.
        ((0.05, 2.0), 1.0, None, (1, 1), 1.0),
        ((0.05, 2.0), 3.0, None, (0, 2), -1.0),
    ],
    ids=["before", "after", "between the end and it", "none, after", "none, before"],
)
def test_a_command_counts_after_the_message_that_reveals_a_takeover(
    after_s: tuple[float, ...],
    ended_s: float,
    shows: Callable[[Message], bool] | None,
    commands: tuple[int, int],
    last_s: float,
) -> None:
    kept, taken_s = taken_over(*after_s)
    found = reaction(kept, taken_s, taken_s + ended_s, shows)
    assert (found.commands_after, found.crossed) == commands
    assert found.last_command_s == pytest.approx(last_s)
    assert found.shown_s == (None if shows is None else pytest.approx(0.1))


def test_every_takeover_is_one_of_an_autopilot_and_has_its_own_name() -> None:
    for flavour in ("px4", "ardupilot"):
        names = [one.name for one in takeovers_of(flavour)]
        assert len(set(names)) == len(names) > 10
    assert "pause by 193" not in [one.name for one in takeovers_of("px4")]


def test_what_uavrt_does_not_speak_is_framed_for_the_autopilots() -> None:
    sticks = (1500).to_bytes(2, "little") * 8 + bytes((1, 1))
    raw = FrameWriter(255, 190).encode(Foreign(70, 124, sticks))
    assert raw.hex() == "fd12000000ffbe460000" + "dc05" * 8 + "0101" + raw[-2:].hex()


# ------------------------------------------------------------------- what is flown


def test_one_of_each_is_flown_before_others() -> None:
    build = replace(simulated_build("px4"), simulated=False)
    flights = list(planned([build], Asked(surveys=3, takeoffs=2, searches=1, phases=2)))
    assert len({one.name for one in flights}) == len(flights)
    first = flights[: len(ORDERS) + len(takeovers_of("px4"))]
    assert [one.order for one in first[: len(ORDERS)]] == list(ORDERS)
    assert all(one.number == 0 for one in first)
    assert sum(one.order == "survey" and one.takeover is None for one in flights) == 3


def test_the_simulated_autopilot_is_not_asked_for_takeovers_that_it_cannot_read() -> None:
    simulated = simulated_build("ardupilot")
    names = [
        {one.takeover.name for one in planned([build], Asked(phases=1)) if one.takeover}
        for build in (replace(simulated, simulated=False), simulated)
    ]
    assert names[0] - names[1] == {"velocity", "stick", "fence", "battery"}


def test_a_part_of_a_name_chooses_flights() -> None:
    flights = list(planned([simulated_build("ardupilot")], Asked(only="pause by 193")))
    assert [one.number for one in flights] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("only", "phases", "orders"), [("nonsense", 5, 5), ("", 0, 0), ("pause by 193", 5, 5)]
)
def test_a_rehearsal_of_no_flight_is_refused(
    only: str, phases: int, orders: int, tmp_path: Path
) -> None:
    counts = dict.fromkeys(("surveys", "searches", "takeoffs", "others"), orders)
    asked = Asked(**counts, phases=phases, only=only)
    with pytest.raises(UsageError, match=r"no flight .*is requested\. Choose others"):
        rehearse([simulated_build("px4")], asked, tmp_path, KeptOutcomes(), [], print)


@pytest.mark.parametrize(("starts", "flown"), [("+-+--+", 3), ("-", 0), ("+" + TRIES * "-", 1)])
def test_an_autopilot_that_does_not_start_again_is_started_up_to_four_times(
    starts: str, flown: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On an overloaded computer one start may fail; those flown before it are kept."""
    left, said = list(starts), list[str]()

    async def session(_build: Any, flights: list[Any], *_others: Any) -> None:
        if left.pop(0) == "-":
            raise UavrtError("no drone is heard")
        said.append(flights.pop(0).name)

    monkeypatch.setattr(flown_flights, "_session", session)
    asked = Asked(surveys=3, searches=0, takeoffs=0, others=0, phases=0)
    fly = partial(
        rehearse, [simulated_build("px4")], asked, tmp_path, KeptOutcomes(), [], print
    )
    failure = pytest.raises(UavrtError, match="no drone is heard")
    with nullcontext() if flown == 3 else failure:
        fly()
    assert (len(said), left) == (flown, [])


def test_an_arrival_noted_with_a_late_link_is_an_arrival() -> None:
    assert has_arrived("done: the autopilot's messages arrive 0.3 s late")
    assert not has_arrived("another program turns the drone")


async def test_waiting_for_an_autopilot_ends_with_its_program() -> None:
    class Deaf:
        heard = None

    def ended() -> None:
        raise UavrtError("autopilot ended (exit 3)")

    hand = Hand(Deaf(), "px4")  # type: ignore[arg-type]
    hand.check = ended
    with pytest.raises(UavrtError, match=r"autopilot ended \(exit 3\)"):
        await hand.boot(60.0)


def test_a_build_that_has_changed_is_another(tmp_path: Path) -> None:
    program = tmp_path / "arducopter"
    names = []
    for words in ("one", "two", "one"):
        program.write_text(words)
        program.chmod(0o755)
        names.append(arducopter_build(program).name)
    assert names[0] == names[2] != names[1]
    assert names[0].startswith("ArduCopter SITL ")


def px4_directory(top: Path, *airframes: str) -> Path:
    build = top / "build/px4_sitl_default"
    (build / "bin").mkdir(parents=True)
    (build / "bin/px4").touch()
    folder = build / "etc/init.d-posix/airframes"
    folder.mkdir(parents=True)
    for name in airframes:
        (folder / name).touch()
    return build


def test_px4_is_found_in_its_sources_and_in_its_build(tmp_path: Path) -> None:
    build = px4_directory(tmp_path, "10040_sihsim_quadx")
    for place in (tmp_path, build):
        assert px4_build(place).program == build / "bin/px4"


def test_what_is_no_build_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no bin/px4, there or in build/px4_sitl_default"):
        px4_build(tmp_path)
    for airframes in ((), ("4001_gz_x500",)):
        sources = tmp_path / f"px4 {len(airframes)}"
        px4_directory(sources, *airframes)
        with pytest.raises(UsageError, match=r"no airframe sihsim_quadx.*px4_sitl_default"):
            px4_build(sources)
    for place in (tmp_path, tmp_path / "none"):
        with pytest.raises(UsageError, match=r"is not a program.*for the board sitl"):
            arducopter_build(place)


@pytest.mark.parametrize(
    ("name", "flavour"),
    [
        ("PX4 SIH", "px4"),
        ("simulated px4", "px4"),
        ("ArduCopter", "ardupilot"),
        ("simulated ardupilot", "ardupilot"),
    ],
)
def test_builds_are_told_apart_by_their_names(name: str, flavour: str) -> None:
    assert flavour_of(name) == flavour


# ----------------------------------------------------------------------- the table


def outcome(
    order: str, takeover: str | None = None, *, build: str = "PX4 SIH", **values: Any
) -> Any:
    known = {"build": build, "order": order, "takeover": takeover, "ended": "done"}
    return known | {"arrived": takeover is None} | values


def paused(out_s: float | None, **changed: Any) -> Any:
    return outcome("goto", "pause", reaction=REACTION | changed, out_s=out_s)


REACTION = {"shown_s": 0.1, "last_command_s": -2.0, "commands_after": 0, "crossed": 0}
WELL = [
    outcome("survey", flying={"overshoot_m": [1.0, 2.0, 3.0]}),
    outcome("search", pulses=[9, 9], yaw_errors_deg=[0.3, -0.4]),
    paused(0.2),
]


def test_a_table_of_a_good_rehearsal_has_no_fault() -> None:
    page = as_page(WELL)
    assert "| PX4 SIH | survey | 1 of 1 |  |" in page
    assert "| PX4 SIH | pause | 1 | 0 | -2.000 | 0.200 |  |" in page
    assert "| PX4 SIH | overshoot, m | 2.000 | 3.000 | 3 |" in page
    assert "| PX4 SIH | yaw of pulses, ° rms | 0.354 | 0.400 | 2 |" in page
    assert "| PX4 SIH | pulses delivered | 9 of 9 |  | 1 |" in page
    summary = as_json(WELL)
    assert summary["faults"] == []
    assert json.loads(json.dumps(summary))["orders"][0]["ended by arrival"] == "1 of 1"


@pytest.mark.parametrize(
    ("bad", "fault"),
    [
        (
            outcome("survey", ended="another program turns the drone", arrived=False),
            'survey: ended by "another program turns the drone"',
        ),
        (
            outcome("goto", ended="lost", arrived=False, relay_late_s=1.3),
            'goto: ended by "lost (the rehearsal passed frames on too late: repeat on a quiet '
            'computer)"',
        ),
        (paused(1.0, commands_after=2, last_command_s=9.0), "pause: 2 commands after it"),
        (paused(None), "pause: the order did not end"),
        (
            paused(4.2, shown_s=None),
            "pause: no message shows it, and the order ended only 4.2 s after it",
        ),
        (
            {"build": "PX4 SIH", "order": "goto", "takeover": None, "failed": "no position"},
            "goto: no position",
        ),
    ],
)
def test_what_an_integrator_must_look_at_is_named(bad: Any, fault: str) -> None:
    summary = as_json([*WELL, bad])
    assert summary["faults"] == [f"PX4 SIH, {fault}"]
    assert as_page([*WELL, bad]) != as_page(WELL)


@pytest.mark.parametrize(
    ("ours", "verdict"), [(2.3, "within 20%"), (1.5, "beyond 20%"), (2.5, "beyond 20%")]
)
def test_a_simulated_autopilot_is_compared_with_the_real_one(ours: float, verdict: str) -> None:
    simulated = outcome("survey", build="simulated px4", flying={"overshoot_m": [ours]})
    _, *lines = compared([*WELL, simulated])
    assert [line[-1] for line in lines if line[1] == "overshoot, m"] == [verdict]
    assert compared(WELL)[1:] == []
