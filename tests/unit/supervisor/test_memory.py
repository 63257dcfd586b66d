"""What survives the supervisor, and what does not."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.clock import Clock, wall_ns
from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.errors import ConfigError
from uavrt.messages import Command, FlightInfo, SystemState, Tag
from uavrt.supervisor.memory import STATE_NAME, SavedState, StateStore
from uavrt.supervisor.mission import Mission

TAG = Tag(tag_id=2, frequency_hz=148_710_000.0, pulse_width_s=0.02, pulse_intervals_s=(1.254,))


def new_mission(directory: Path) -> Mission:
    """A mission as a freshly started supervisor has it."""
    return Mission(
        Settings(
            recording=RecordingSettings(directory=str(directory)),
            radio=RadioSettings(center_frequency_hz=148.7e6),
        ),
        StateStore(directory),
        tell=lambda _severity, _text: None,
        on_start=lambda _flight: None,
        on_stop=lambda: None,
    )


def upload(mission: Mission, *names: str) -> None:
    for number, name in enumerate(names):
        reply = mission.command(
            Command(
                name=name,  # type: ignore[arg-type]
                request_id=number,
                tag=TAG if name == "add_tag" else None,
                gain=17 if name == "start_detection" else None,
            )
        )
        assert reply.accepted, reply.message


START = ("start_tags", "add_tag", "end_tags", "start_detection")


def test_a_flight_goes_on_with_its_tags_gain_clock_and_directory(tmp_path: Path) -> None:
    before = new_mission(tmp_path)
    before.clock = Clock(before.clock.offset_ns - 12_345_678_901)
    upload(before, *START)
    after = new_mission(tmp_path)
    assert after.resume()
    assert after.state is SystemState.DETECTING
    assert after.tags == before.tags
    assert after.flight == before.flight
    assert after.settings.radio.gain == 17
    assert after.clock == before.clock


@pytest.mark.parametrize(
    ("commands", "state"),
    [
        ((), SystemState.IDLE),
        (START[:1], SystemState.IDLE),
        (START[:2], SystemState.IDLE),
        (START[:3], SystemState.HAS_TAGS),
        (START, SystemState.DETECTING),
        ((*START, "stop_detection"), SystemState.HAS_TAGS),
    ],
)
def test_what_was_acknowledged_is_there_again(
    tmp_path: Path, commands: tuple[str, ...], state: SystemState
) -> None:
    upload(new_mission(tmp_path), *commands)
    after = new_mission(tmp_path)
    after.resume()
    assert after.state is state
    assert bool(after.tags) == (state in (SystemState.HAS_TAGS, SystemState.DETECTING))


def test_after_an_end_in_good_order_everything_begins_afresh(tmp_path: Path) -> None:
    before = new_mission(tmp_path)
    upload(before, *START)
    before.forget()
    after = new_mission(tmp_path)
    assert not after.resume()
    assert after.state is SystemState.IDLE
    assert not after.tags


def rebooted(
    directory: Path, monkeypatch: pytest.MonkeyPatch, *, off_s: float
) -> tuple[FlightInfo, Mission]:
    """A flight cut off by the battery, and the mission of the next boot."""
    before = new_mission(directory)
    upload(before, *START)
    assert before.flight is not None
    (Path(before.flight.directory) / "flight.sqlite").write_bytes(b"")
    monkeypatch.setattr("uavrt.supervisor.mission.boot_id", lambda: "the next boot")
    now_ns = wall_ns()
    monkeypatch.setattr("uavrt.supervisor.mission.wall_ns", lambda: now_ns + round(off_s * 1e9))
    return before.flight, new_mission(directory)


def test_after_a_brown_out_a_new_flight_begins_on_a_new_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight, after = rebooted(tmp_path, monkeypatch, off_s=40.0)
    own_clock = after.clock
    assert after.resume()
    assert after.flight is not None
    assert after.flight.directory != flight.directory
    assert after.flight.center_frequency_hz == flight.center_frequency_hz
    assert after.clock == own_clock


def test_last_weeks_flight_does_not_start_the_radio(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, after = rebooted(tmp_path, monkeypatch, off_s=7 * 86_400.0)
    assert not after.resume()
    assert after.state is SystemState.HAS_TAGS
    assert after.tags == {2: TAG}


def test_a_flight_whose_directory_is_gone_goes_on_in_a_new_one(tmp_path: Path) -> None:
    before = new_mission(tmp_path)
    upload(before, *START)
    assert before.flight is not None
    Path(before.flight.directory).rmdir()
    after = new_mission(tmp_path)
    assert after.resume()
    assert after.flight is not None
    assert Path(after.flight.directory).is_dir()


@given(st.binary(max_size=200), st.integers(0, 400))
@settings(deadline=None)
def test_a_damaged_file_is_put_aside_and_stops_nothing(
    tmp_path_factory: pytest.TempPathFactory, garbage: bytes, keep: int
) -> None:
    directory = tmp_path_factory.mktemp("flights")
    store = StateStore(directory)
    state = SavedState(
        boot_id="b",
        clock_offset_ns=1,
        state=SystemState.HAS_TAGS,
        tags=(TAG,),
        flight=None,
    )
    store.save(state)
    assert store.load() == state
    path = directory / STATE_NAME
    whole = path.read_bytes()
    torn = whole[:keep] + garbage
    path.write_bytes(torn)
    loaded = store.load()
    assert (loaded is None) == (not path.exists())


def test_only_one_supervisor_flies_from_a_directory(tmp_path: Path) -> None:
    first, second = StateStore(tmp_path), StateStore(tmp_path)
    first.claim()
    with pytest.raises(ConfigError, match="already runs"):
        second.claim()


def test_a_disk_that_cannot_be_written_costs_the_memory_only(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    store = StateStore(blocked / "flights")
    store.claim()
    mission = new_mission(tmp_path)
    state = replace(
        SavedState(
            boot_id="b",
            clock_offset_ns=0,
            state=mission.state,
            tags=(),
            flight=None,
        )
    )
    store.save(state)
    assert store.load() is None
