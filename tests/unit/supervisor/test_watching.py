"""Restart policy, budgets and the disk guard."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from operated import Operator

from uavrt.config.settings import RecordingSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.units import s_from_ns
from uavrt.detection.track.pulse_reporting import _REPORT_EVERY_NS
from uavrt.drone.ipc.topics import TOPICS
from uavrt.drone.supervisor.mission.storage.disk_guard import DiskGuard
from uavrt.drone.supervisor.pace import PaceWatch
from uavrt.drone.supervisor.start.launcher import Launcher
from uavrt.drone.supervisor.start.restarts import FLIGHT_RESTARTS, RestartPolicy, Restarts
from uavrt.drone.supervisor.tree.instance import Instance
from uavrt.drone.supervisor.tree.process_budgets import (
    CPU_ALLOWANCE,
    REPEAT_S,
    WINDOW_S,
    BudgetWatch,
)
from uavrt.drone.supervisor.tree.process_tree import ProcessTree
from uavrt.drone.supervisor.tree.table import PROCESSES
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import FLIGHT_ORDER, flights_in_order, note_flight


def test_the_first_restart_comes_at_once_and_the_next_ones_ever_later() -> None:
    restarts = Restarts()
    waits = []
    now_s = 100.0
    for _ in range(8):
        restarts.started(now_s)
        waits.append(restarts.ended(now_s + 0.1, "ended (exit 1)"))
        assert restarts.not_before_s == pytest.approx(now_s + 0.1 + waits[-1])
        now_s += 1.0
    assert tuple(waits) == (*FLIGHT_RESTARTS.delays_s, *[FLIGHT_RESTARTS.delays_s[-1]] * 3)
    assert restarts.degraded(now_s)
    assert restarts.total == 8


def test_a_row_may_have_a_policy_of_its_own() -> None:
    restarts = Restarts(RestartPolicy(delays_s=(3.0,), degraded_after=1))
    restarts.started(0.0)
    assert restarts.ended(0.1, "ended (exit 1)") == 3.0
    assert restarts.degraded(0.2)


@given(st.integers(1, 12))
def test_one_settled_life_forgives_all(ends: int) -> None:
    restarts = Restarts()
    for _ in range(ends):
        restarts.started(0.0)
        restarts.ended(0.1, "x")
    assert restarts.degraded(0.2) == (ends >= FLIGHT_RESTARTS.degraded_after)
    restarts.started(10.0)
    assert not restarts.degraded(10.1 + FLIGHT_RESTARTS.settled_s)
    assert restarts.ended(10.1 + FLIGHT_RESTARTS.settled_s, "x") == 0.0


def watched(cpu_percent: float, seconds: int, memory_mb: float = 10.0) -> list[str]:
    watch = BudgetWatch("detector-1", cpu_percent=5.0, memory_mb=100.0)
    texts = [watch.check(t, t * cpu_percent / 100.0, memory_mb) for t in range(seconds)]
    return [text for text in texts if text is not None]


def test_a_process_within_its_budget_is_not_mentioned() -> None:
    assert watched(5.0 * CPU_ALLOWANCE * 0.99, 1000) == []


def test_a_busy_process_is_reported_after_a_while_and_not_every_second() -> None:
    texts = watched(5.0 * CPU_ALLOWANCE * 1.5, round(WINDOW_S + REPEAT_S + 10))
    assert len(texts) == 2
    assert "detector-1 uses 30 % of a core" in texts[0]
    assert watched(5.0 * CPU_ALLOWANCE * 1.5, round(WINDOW_S)) == []


def test_a_growing_process_is_reported() -> None:
    assert "uses 101 MB (budget 100 MB)" in watched(0.0, 5, memory_mb=101.0)[0]


REMOVES = RecordingSettings(
    minimum_free_mb=1e12, remove_oldest_flights=True, keep_newest_flights=1
)


def flights(directory: Path, *names: str) -> list[Path]:
    made = [directory / f"flight_log_{name}" for name in names]
    for path in made:
        (path / "iq").mkdir(parents=True)
        (path / "flight.sqlite").write_bytes(b"x")
    return made


def test_without_leave_nothing_is_removed_and_the_operator_hears_once(tmp_path: Path) -> None:
    flights(tmp_path, "2026-01-01", "2026-01-02")
    guard = DiskGuard(tmp_path, RecordingSettings(minimum_free_mb=1e12))
    first = guard.check()
    assert len(first) == 1
    assert "Disk nearly full" in first[0][1]
    assert guard.check() == []
    assert [fault.text for fault in guard.faults] == [first[0][1]]
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("looked", [False, True])
def test_a_disk_that_cannot_be_measured_tells_nothing(tmp_path: Path, looked: bool) -> None:
    guard = DiskGuard(tmp_path / "absent", RecordingSettings())
    if looked:
        assert guard.check() == []
    assert guard.free_mb is None


def test_the_oldest_go_first_and_the_present_flight_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two, three = flights(tmp_path, "2026-01-01", "2026-01-02", "2026-01-03")
    other = tmp_path / "photographs"
    other.mkdir()
    guard = DiskGuard(tmp_path, replace(REMOVES, minimum_free_mb=100.0))
    # Each flight here "weighs" 40 MB of a disk of 200.
    monkeypatch.setattr(
        guard, "_measure", lambda: 200.0 - 40.0 * len(list(tmp_path.glob("flight_log_*")))
    )
    guard.flying(one)
    texts = [text for _, text in guard.check()]
    assert texts == [f"Disk nearly full: removed {two.name}"]
    assert one.exists()
    assert three.exists()
    assert other.exists()


def test_kept_channels_of_old_flights_go_before_any_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    starred, one, two, present = flights(
        tmp_path, "2026-01-01", "2026-01-02", "2026-01-03", "2026-01-04"
    )
    FlightLayout(starred).star.touch()
    for flight in (starred, one, two, present):
        channels = FlightLayout(flight).channels_directory
        channels.mkdir(parents=True)
        (channels / "channel_1_Hz_0001.sigmf-data").write_bytes(b"1234")
    guard = DiskGuard(tmp_path, replace(REMOVES, minimum_free_mb=100.0))
    guard.flying(present)

    def free_mb() -> float:
        kept = len(list(tmp_path.glob("*/iq/channels/*")))
        return 250.0 - 40.0 * kept - 20.0 * len(list(tmp_path.glob("flight_log_*")))

    monkeypatch.setattr(guard, "_measure", free_mb)
    assert [text for _, text in guard.check()] == [
        f"Disk nearly full: removed samples of {one.name}",
        f"Disk nearly full: removed samples of {two.name}",
        f"Disk nearly full: removed {one.name}",
    ]
    assert FlightLayout(starred).channels_directory.is_dir()
    assert FlightLayout(present).channels_directory.is_dir()
    assert two.is_dir()


def test_the_only_flight_is_never_removed(tmp_path: Path) -> None:
    (only,) = flights(tmp_path, "2026-01-01")
    guard = DiskGuard(tmp_path, REMOVES)
    guard.flying(only)
    assert "Detection goes on" in guard.check()[0][1]
    assert only.exists()


def test_a_flight_that_a_full_disk_could_not_note_is_noted_later(tmp_path: Path) -> None:
    """Else it would be taken for one from before the notes began, and be the first to go."""
    before, last = flights(tmp_path, "2026-01-01", "1970-01-01")
    note_flight(before)
    order = tmp_path / FLIGHT_ORDER
    noted = order.read_bytes()
    order.unlink()
    order.mkdir()  # what cannot be written, also by root
    guard = DiskGuard(tmp_path, RecordingSettings(minimum_free_mb=0.0))
    guard.flying(last)
    assert guard.check() == []
    guard.flying(None)
    order.rmdir()
    order.write_bytes(noted)
    assert guard.check() == []
    assert flights_in_order(tmp_path) == [before, last]


def test_a_link_to_elsewhere_is_not_followed(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "thesis.tex").write_text("years of work")
    directory = tmp_path / "flights"
    directory.mkdir()
    (directory / "flight_log_2020").symlink_to(elsewhere)
    DiskGuard(directory, REMOVES).check()
    assert (elsewhere / "thesis.tex").exists()


def paced(every_s: float, tags: int = 1, gaps_s: tuple[float, ...] = ()) -> PaceWatch:
    """Watch a detector whose tags have a report so often, with gaps between some of them."""
    watch = PaceWatch("detector-1", ("pulse", "search_report", "health"))
    watch.started(tags)
    now_s = 0.0
    for number in range(60):
        for _ in range(tags):
            watch.record_arrived("search_report", now_s)
        watch.record_arrived("pulse", now_s)
        now_s += every_s + (gaps_s[number] if number < len(gaps_s) else 0.0)
    return watch


@given(st.integers(1, 50))
def test_a_detector_that_keeps_pace_is_not_mentioned(tags: int) -> None:
    assert paced(1.0, tags).check(60.0) is None
    assert paced(1.9, tags).check(60.0) is None


@given(st.integers(1, 50))
def test_a_detector_that_falls_behind_is_told_and_not_every_second(tags: int) -> None:
    watch = paced(3.0, tags)
    text = watch.check(180.0)
    assert text == "detector-1 is too slow: search_report every 3.0 s (1 s)"
    assert watch.check(181.0) is None
    assert watch.slow
    assert watch.check(181.0 + REPEAT_S) is not None


def test_a_radio_that_was_away_does_not_make_a_detector_slow() -> None:
    assert paced(1.0, gaps_s=(0.0,) * 50 + (25.0,)).check(90.0) is None


def test_detectors_report_as_often_as_the_table_says() -> None:
    assert TOPICS["search_report"].every_s == s_from_ns(_REPORT_EVERY_NS)


def test_a_new_process_is_judged_by_its_own_records() -> None:
    watch = paced(3.0)
    watch.started(1)
    assert watch.check(180.0) is None
    assert not watch.slow


def test_what_was_degraded_in_one_flight_is_not_in_the_next(tmp_path: Path) -> None:
    receiver = next(row for row in PROCESSES if row.name == "receiver")
    process_tree = ProcessTree(
        (receiver,),
        Operator(tmp_path).mission,
        launcher=Launcher(),
        workers=1,
        notify=lambda _severity, _text: None,
        on_line=lambda _instance, _line: None,
        on_output=lambda _instance, _line: None,
        wake=lambda: None,
    )
    instance: Instance = process_tree.instance_of(receiver)
    for _ in range(10):
        instance.restarts.started(monotonic_s())
        instance.restarts.ended(monotonic_s(), "ended (exit 1)")
    assert instance.status().status == "degraded: ended (exit 1)"
    asyncio.run(process_tree.stop_flight())
    assert instance.status().status == "stopped"
    assert instance.restarts.not_before_s == 0.0, "the next flight does not wait for it"
