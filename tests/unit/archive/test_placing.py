"""Bearings and positions of an archive are those of `uavrt localize`, flight by flight."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from archived import (
    CENTER_HZ,
    COLUMNS,
    RATE_HZ,
    START,
    TAG_LINE,
    TAGS,
    poses,
    recorded_flight,
)
from command_line import Ran
from past_flight import write_flight as write_heard

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary
from uavrt.analysis.archive.steps.flight_work import PlacingSettings
from uavrt.analysis.measure.tag_source import TagSource, read_tag_source
from uavrt.core.errors import UsageError

PLACE = ("--sample-rate", RATE_HZ, "--center-frequency", CENTER_HZ, "--start-time", START)


def run(folder: Path, output: Path, settings: BatchSettings | None = None) -> BatchSummary:
    manifest = folder / "manifest.csv"
    found = find_recordings([folder], read_manifest(manifest) if manifest.is_file() else None)
    sought = TagSource(tags=TAGS[:1])
    if (folder / "tags.txt").is_file():
        sought = read_tag_source(folder / "tags.txt")
    return run_batch(found, sought, output, settings or BatchSettings())


def localized(ran: Ran, *arguments: object) -> dict[str, Any]:
    """What `uavrt localize` says of the only tag."""
    found: list[dict[str, Any]] = ran("localize", *arguments, "--json").json
    assert len(found) == 1
    return found[0]


def same_place(row: dict[str, object], found: dict[str, Any]) -> bool:
    names = ("tag_id", "latitude_deg", "longitude_deg", "radius95_m", "bearings", "at_edge")
    return all(row[name] == found[name] for name in names)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with a recording; the same recording alone, with a track beside it."""
    folder = tmp_path_factory.mktemp("archive")
    flight = recorded_flight(folder)
    (folder / "alone.cf32").write_bytes((flight / "iq" / "a.cf32").read_bytes())
    lines = [
        "time_ns,latitude_deg,longitude_deg,altitude_amsl_m,altitude_relative_m,qw,qx,qy,qz"
    ]
    for pose in poses():
        place = (pose.latitude_deg, pose.longitude_deg, pose.altitude_amsl_m)
        numbers = (*place, pose.altitude_relative_m, *pose.quaternion_wxyz)
        lines.append(",".join(map(repr, (pose.time_ns, *numbers))))
    (folder / "telemetry.csv").write_text("\n".join(lines) + "\n")
    (folder / "manifest.csv").write_text(
        f"{COLUMNS},track,clock_offset_s\n"
        f"flight_a/iq/a.cf32,,{RATE_HZ},{CENTER_HZ},{START},,\n"
        f"alone.cf32,,{RATE_HZ},{CENTER_HZ},{START},telemetry.csv,0\n"
    )
    (folder / "tags.txt").write_text(TAG_LINE)
    return folder


@pytest.fixture(scope="module")
def searched(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("searched")
    summary = run(archive, output)
    assert (summary.done_now, summary.placed_now) == (2, 2)
    assert [(row.state, row.fault) for row in summary.flights] == [("done", None)] * 2
    return output


def test_a_flight_is_placed_as_by_detect_and_localize(
    archive: Path, searched: Path, tmp_path: Path, ran: Ran
) -> None:
    again, flight = tmp_path / "again", archive / "flight_a"
    detect = ("detect", flight / "iq" / "a.cf32", "--tags", archive / "tags.txt", *PLACE)
    ran(*detect, "--flight", flight, "-o", again)
    found = localized(ran, again)
    (row,) = ask(searched, "select * from positions where flight = 'flight_a'").to_pylist()
    assert same_place(row, found)
    bearings = ask(searched, "select * from bearings where flight = 'flight_a'").to_pylist()
    said = ran("bearing", again, "--json").json
    assert len(said) == 2
    for name in ("bearing_deg", "sigma_deg", "start_time_ns", "latitude_deg", "evidence"):
        assert [one[name] for one in bearings] == [one[name] for one in said]


def test_a_recording_with_a_track_is_placed_as_by_attach_and_localize(
    archive: Path, searched: Path, tmp_path: Path, ran: Ran
) -> None:
    pulses, attached = tmp_path / "pulses.csv", tmp_path / "attached.csv"
    detect = ("detect", archive / "alone.cf32", "--tags", archive / "tags.txt", *PLACE)
    ran(*detect, "-o", pulses)
    track = archive / "telemetry.csv"
    ran("attach", pulses, track, "--clock-offset", 0, "-o", attached)
    found = localized(ran, attached)
    (row,) = ask(searched, "select * from positions where flight = 'alone'").to_pylist()
    for name in ("latitude_deg", "longitude_deg", "radius95_m"):
        assert row[name] == pytest.approx(found[name], rel=1e-6)  # the file rounds


def test_poses_stand_beside_their_pulses(searched: Path) -> None:
    joined = ask(
        searched,
        "select count(*) as n, max(abs(poses.time_ns - pulses.start_time_ns)) as apart_ns "
        "from pulses join poses using (flight, recording, tag_id, start_time_ns)",
    ).to_pylist()[0]
    assert joined["n"] == pq.read_table(searched / "pulses").num_rows > 40
    assert joined["apart_ns"] <= 20_000_000


def test_another_antenna_detects_nothing_again(archive: Path, searched: Path) -> None:
    def mtimes() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in (searched / "pulses").glob("*")}

    before = mtimes()
    other = BatchSettings(placing=PlacingSettings(antenna="H3"))
    summary = run(archive, searched, other)
    assert (summary.done_now, summary.done_before) == (0, 2)
    assert (summary.placed_now, summary.placed_before) == (2, 0)
    assert {row.antenna for row in summary.flights} == {"H3"}
    assert mtimes() == before
    # Without one it is the drone's own.
    own = run(archive, searched)
    assert {row.antenna for row in own.flights} == {"RA-23K"}
    run(archive, searched, other)
    # Only one set of bearings is left of each flight.
    assert ask(searched, "select count(*) as n from bearings")["n"].to_pylist() == [4]
    # Back again, and then nothing is left to do.
    run(archive, searched)
    third = run(archive, searched)
    assert (third.done_now, third.placed_now, third.placed_before) == (0, 0, 2)


def test_only_the_steps_asked_for_are_done(archive: Path, tmp_path: Path) -> None:
    first = run(archive, tmp_path, BatchSettings(steps=("attach", "bearing")))
    # Nothing is detected: the flight has no pulse of its own.
    assert (first.done_now, first.placed_now) == (0, 1)
    assert first.flights[0].pulses == 0
    with pytest.raises(UsageError, match="localize needs the step bearing"):
        run(archive, tmp_path, BatchSettings(steps=("attach", "localize")))
    with pytest.raises(UsageError, match="no step fly"):
        run(archive, tmp_path, BatchSettings(steps=("fly",)))


def test_a_flight_without_a_recording_gives_the_pulses_it_heard(
    tmp_path: Path, ran: Ran
) -> None:
    folder, output = tmp_path / "archive", tmp_path / "searched"
    folder.mkdir()
    name = write_heard(folder, 120.0, 300.0)
    broken = folder / "flight_broken"
    broken.mkdir()
    (broken / "flight.sqlite").write_bytes(b"rubbish" * 100)
    summary = run(folder, output)
    assert [row.state for row in summary.rows] == ["recorded"]
    said = {row.flight: row.state for row in summary.flights}
    assert said == {name: "done", "flight_broken": "failed"}
    (row,) = ask(output, "select * from positions").to_pylist()
    assert same_place(row, localized(ran, folder / name))
    assert ask(output, "select count(*) as n from pulses")["n"].to_pylist() == [72]
    # Its signal strength alone, as of a monopole.
    strength = replace(PlacingSettings(), antenna="monopole")
    run(folder, output, BatchSettings(placing=strength))
    (row,) = ask(output, "select * from positions").to_pylist()
    found = localized(ran, folder / name, "--antenna", "monopole")
    assert (row["powers"], row["latitude_deg"]) == (found["powers"], found["latitude_deg"])
