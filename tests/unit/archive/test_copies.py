"""A flight that is there as the drone and as the ground station recorded it counts once."""

import shutil
from pathlib import Path

import pytest
from archived import TAG_LINE, TAGS, write_flight
from command_line import Ran
from past_flight import write_flight as write_heard
from sql import sql

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import find_recordings
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary
from uavrt.analysis.measure.tag_source import TagSource


def search(output: Path, *paths: Path) -> BatchSummary:
    return run_batch(find_recordings(paths), TagSource(tags=TAGS[:1]), output, BatchSettings())


def copy_of(flight: Path, copy: Path, *, without: int = 0) -> Path:
    """The drone's own record: it began before, its times are to the nanosecond."""
    shutil.copytree(flight, copy)
    sql(
        copy,
        "UPDATE flight SET start_time_ns = start_time_ns - 700000000",
        "UPDATE pulses SET start_time_ns = start_time_ns + 37123",
        "DELETE FROM pulses WHERE start_time_ns IN "
        f"(SELECT start_time_ns FROM pulses ORDER BY start_time_ns LIMIT {without})",
    )
    return copy


@pytest.fixture
def both(tmp_path: Path) -> tuple[Path, Path]:
    """The ground station's record of a flight, and the drone's."""
    ground = tmp_path / "ground"
    ground.mkdir()
    flight = ground / write_heard(ground, 120.0, 300.0)
    return flight, copy_of(flight, tmp_path / "drone-1" / "flight_log_of_the_drone")


def heard(output: Path) -> tuple[list[str], int]:
    rows = ask(output, "select flight, count(*) as n from pulses group by 1").to_pylist()
    return [row["flight"] for row in rows], sum(row["n"] for row in rows)


def test_the_drones_and_the_ground_stations_record_are_one_flight(
    both: tuple[Path, Path], tmp_path: Path, ran: Ran
) -> None:
    output, tags = tmp_path / "searched", tmp_path / "tags.txt"
    tags.write_text(TAG_LINE)
    paths = (tmp_path / "ground", tmp_path / "drone-1")
    command = ("batch", *paths, "--tags", tags, "-o", output, "--workers", 1)
    for _ in range(2):
        assert "1 flight skipped: copies" in ran(*command).err
        names, pulses = heard(output)
        assert (len(names), pulses) == (1, 72)
        (row,) = ask(output, "select path, copies from flights").to_pylist()
        assert {row["path"], row["copies"]} == set(map(str, both))
        assert ask(output, "select * from positions").num_rows == 1


def test_the_record_that_holds_more_counts_whichever_comes_first(
    both: tuple[Path, Path], tmp_path: Path
) -> None:
    ground, drone = both
    output = tmp_path / "searched"
    first = "(SELECT min(start_time_ns) FROM pulses)"
    sql(ground, f"DELETE FROM pulses WHERE start_time_ns = {first}")
    search(output, ground)
    assert heard(output) == ([ground.name], 71)
    summary = search(output, ground, drone)
    assert (summary.copies, summary.placed_now) == (1, 1)
    assert heard(output) == ([drone.name], 72)
    # Without the drone's disk the ground station's record stays a copy.
    drone.rename(drone.with_name("away"))
    summary = search(output, ground)
    assert (summary.copies, summary.placed_now) == (1, 0)
    assert heard(output) == ([drone.name], 72)


def test_a_record_with_samples_counts_before_one_with_more_pulses(
    both: tuple[Path, Path], tmp_path: Path
) -> None:
    ground, _ = both
    drone = copy_of(ground, tmp_path / "drone-2" / "own", without=3)
    (drone / "iq" / "channels").mkdir(parents=True)
    (drone / "iq" / "channels" / "a.sigmf-meta").touch()
    output = tmp_path / "searched"
    search(output, ground, drone)
    assert heard(output) == (["own"], 69)


@pytest.mark.parametrize("beside_ns", [-499_999, -40_000, 0, 460_000, 499_999])
def test_copies_are_found_wherever_in_a_millisecond_the_pulses_lie(
    both: tuple[Path, Path], tmp_path: Path, beside_ns: int
) -> None:
    """At an edge of rounded milliseconds all pulses of an exact interval were others."""
    ground, drone = both
    ((first_ns,),) = sql(ground, "SELECT min(start_time_ns) FROM pulses")
    later_ns = beside_ns - first_ns % 1_000_000
    for directory in both:
        sql(directory, f"UPDATE pulses SET start_time_ns = start_time_ns + {later_ns}")
    assert search(tmp_path / "searched", ground, drone).copies == 1


def test_two_drones_that_hear_the_same_pulses_are_two_flights(
    both: tuple[Path, Path], tmp_path: Path
) -> None:
    ground, _ = both
    other = copy_of(ground, tmp_path / "drone-2" / "flight_log_of_another")
    sql(other, "UPDATE pulses SET snr_db = snr_db - 5.0")
    copy_of(other, tmp_path / "kept" / "of_another", without=1)
    output = tmp_path / "searched"
    summary = search(output, tmp_path)
    assert summary.copies == 2
    names, pulses = heard(output)
    assert (len(names), pulses) == (2, 144)


def test_two_silent_flights_that_kept_samples_are_two(tmp_path: Path) -> None:
    for name in ("drone-1", "drone-2", "ground"):
        flight = write_flight(tmp_path / name / "flight_log")
        if name != "ground":
            (flight / "iq" / "channels").mkdir(parents=True)
            (flight / "iq" / "channels" / "a.sigmf-meta").touch()
    summary = search(tmp_path / "searched", tmp_path)
    assert summary.copies == 1
    names = sorted(row.flight for row in summary.flights)
    assert names == ["drone-1/flight_log", "drone-2/flight_log"]


def test_copies_that_an_older_archive_counted_twice_are_taken_out(
    both: tuple[Path, Path], tmp_path: Path
) -> None:
    ground, drone = both
    output = tmp_path / "searched"
    search(output, ground)
    # As if two flights of other hours: nothing tells that they are the same.
    shift = "SET start_time_ns = start_time_ns + 7200000000000"
    sql(
        drone,
        f"UPDATE flight {shift}",
        f"UPDATE pulses {shift}, end_time_ns = end_time_ns + 7200000000000",
        "UPDATE poses SET time_ns = time_ns + 7200000000000",
    )
    search(output, ground, drone)
    assert heard(output)[1] == 144
    shutil.rmtree(drone)
    copy_of(ground, drone)
    search(output, ground, drone)
    assert heard(output)[1] == 72
