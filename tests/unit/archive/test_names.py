"""A flight has one name in all tables, whatever is in it, and no other flight has it."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from archived import CENTER_HZ, COLUMNS, RATE_HZ, START, TAGS, record
from command_line import Ran

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.flight_search import find_flights
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary
from uavrt.analysis.measure.tag_source import TagSource

SPECIAL = ("my walk", "50 % of it's +1 & ö", "a=b;c?")
TRACK = "time_ns,latitude_deg,longitude_deg,altitude_amsl_m,altitude_relative_m,qw,qx,qy,qz\n"


def search(folder: Path, output: Path, *paths: Path) -> BatchSummary:
    found = find_recordings(paths or [folder], read_manifest(folder / "manifest.csv"))
    return run_batch(found, TagSource(tags=TAGS[:1]), output, BatchSettings())


def archive_of(folder: Path, *names: str, length_s: float = 16.0) -> None:
    lines = [f"{COLUMNS},track,clock_offset_s"]
    for number, name in enumerate(names):
        path = folder / f"{name}.cf32"
        path.parent.mkdir(parents=True, exist_ok=True)
        record(path, length_s, number, tags=TAGS[:1])
        lines.append(f'"{name}.cf32",,{RATE_HZ},{CENTER_HZ},{START},track.csv,0')
    start_ns = 1_777_615_200_000_000_000
    poses = [f"{start_ns + each * 10**9},46.5,8,1000,40,1,0,0,0" for each in range(20)]
    (folder / "track.csv").write_text(TRACK + "\n".join(poses) + "\n")
    (folder / "manifest.csv").write_text("\n".join(lines) + "\n")


def names_in(output: Path, table: str) -> list[str]:
    rows = ask(output, f"select distinct flight from {table} order by flight")
    return [str(one) for one in rows["flight"].to_pylist()]


@pytest.fixture(scope="module")
def special(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder, output = (tmp_path_factory.mktemp(name) for name in ("archive", "searched"))
    archive_of(folder, *SPECIAL)
    search(folder, output)
    return folder, output


def test_a_special_name_is_the_same_in_every_table(special: tuple[Path, Path]) -> None:
    _, output = special
    for table in ("recordings", "flights", "pulses", "poses"):
        assert names_in(output, table) == sorted(SPECIAL), table
    joined = ask(output, "select count(*) as n from pulses join recordings using (flight)")
    assert joined["n"].to_pylist() == [pq.read_table(output / "pulses").num_rows]
    assert set(pq.read_table(output / "pulses")["flight"].to_pylist()) == set(SPECIAL)
    found = find_flights(output, tag_id=2)
    assert sorted(one.flight for one in found.flights) == sorted(SPECIAL)
    assert all(one.heard for one in found.flights)


def test_a_flight_of_a_special_name_is_exported_by_it(
    special: tuple[Path, Path], tmp_path: Path, ran: Ran
) -> None:
    _, output = special
    for name in SPECIAL:
        command = ("archive", "export", output, "--flight", name, "--format", "csv")
        ran(*command, "-o", tmp_path)
    written = sorted(tmp_path.rglob("pulses.csv"))
    assert len(written) == 3
    assert {one.parent.name for one in written[:2]} == {
        SPECIAL[1].replace("%", "%25"),
        "a=b;c%3F",
    }
    assert written[2].parent == tmp_path / "my walk"


def test_recordings_of_the_same_name_are_flights_of_their_own(tmp_path: Path, ran: Ran) -> None:
    folder, output = tmp_path / "archive", tmp_path / "searched"
    archive_of(folder, "2023/walk", "2024/walk", "2024/other")
    search(folder, output)
    names = ["2023/walk", "2024/other", "2024/walk"]
    for table in ("recordings", "flights", "pulses", "poses"):
        assert names_in(output, table) == names, table
    (heard,) = ask(output, "select count(distinct flight) as n from pulses")["n"].to_pylist()
    assert heard == 3
    ran("archive", "export", output, "--format", "csv", "-o", tmp_path / "of")
    for name in names:
        rows = (tmp_path / "of" / name / "pulses.csv").read_text().splitlines()
        (pulses,) = ask(output, f"select count(*) as n from pulses where flight = '{name}'")[
            "n"
        ].to_pylist()
        assert len(rows) == 1 + pulses
    assert search(folder, output).done_before == 3
    assert names_in(output, "recordings") == names


def test_a_name_stays_when_another_of_the_same_comes_later(tmp_path: Path) -> None:
    output = tmp_path / "searched"
    for number, name in enumerate(("2023", "2024")):
        archive_of(tmp_path / name, "walk", length_s=16.0 + number)
        search(tmp_path / name, output, tmp_path / name)
    assert names_in(output, "pulses") == ["2024/walk", "walk"]
    again = search(tmp_path / "2023", output, tmp_path / "2023")
    assert (again.done_before, again.placed_before) == (1, 1)
    assert names_in(output, "flights") == ["2024/walk", "walk"]


def test_two_forms_of_a_recording_are_told_by_their_endings(tmp_path: Path) -> None:
    folder, output = tmp_path / "archive", tmp_path / "searched"
    archive_of(folder, "walk")
    samples = np.fromfile(folder / "walk.cf32", np.float32)
    (1e6 * samples).astype("<i2").tofile(folder / "walk.cs16")
    with (folder / "manifest.csv").open("a") as file:
        file.write(f"walk.cs16,,{RATE_HZ},{CENTER_HZ},{START},track.csv,0\n")
    search(folder, output)
    assert names_in(output, "pulses") == ["walk.cf32", "walk.cs16"]
