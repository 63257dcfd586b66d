"""An archive's flights for other programs are what `uavrt export` makes of each flight."""

import json
import struct
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from archived import TAGS
from command_line import Ran
from past_flight import write_flight

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.exporting import export_archive
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import find_recordings
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.errors import UsageError


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """An archive of a flight that heard a tag itself; and the flight."""
    folder = tmp_path_factory.mktemp("archive")
    name = write_flight(folder, 120.0, 300.0)
    output = tmp_path_factory.mktemp("searched")
    run_batch(find_recordings([folder]), TagSource(tags=TAGS), output, BatchSettings())
    return output, folder / name


def test_the_files_of_a_flight_are_those_of_its_own_export(
    searched: tuple[Path, Path], tmp_path: Path, ran: Ran
) -> None:
    archive, flight = searched
    formats = ("--format", "csv", "geojson", "gpx", "movebank", "uavrt")
    ran("export", flight, *formats, "-o", tmp_path / "own")
    ran("archive", "export", archive, *formats, "-o", tmp_path / "of")
    own = {path.name: path.read_bytes() for path in (tmp_path / "own").iterdir()}
    written = {
        path.name: path.read_bytes() for path in (tmp_path / "of" / flight.name).iterdir()
    }
    drawn, all_drawn = (
        json.loads(files.pop("flight.geojson"))["features"] for files in (written, own)
    )
    assert len(written) >= 7
    assert written == own
    # The outlines of 50 and 95 % are of the heat map, which is in no table.
    missing = [one for one in all_drawn if one not in drawn]
    assert len(drawn) + 2 == len(all_drawn)
    assert {one["geometry"]["type"] for one in missing} == {"MultiLineString"}


def test_bearings_and_positions_are_points_of_geoparquet(
    searched: tuple[Path, Path], tmp_path: Path
) -> None:
    archive, flight = searched
    written = export_archive(archive, tmp_path, ["geoparquet"])
    assert [path.name for path in written] == ["bearings.parquet", "positions.parquet"]
    for path in written:
        read = pq.read_table(path)
        geo = json.loads(read.schema.metadata[b"geo"])
        assert (geo["version"], geo["primary_column"]) == ("1.1.0", "geometry")
        column = geo["columns"]["geometry"]
        assert (column["encoding"], column["geometry_types"]) == ("WKB", ["Point"])
        rows = read.to_pylist()
        assert len(rows) == (2 if path.stem == "bearings" else 1)
        for row in rows:
            assert row["flight"] == flight.name
            order, kind, longitude, latitude = struct.unpack("<BIdd", row["geometry"])
            assert (order, kind) == (1, 1)
            assert (longitude, latitude) == (row["longitude_deg"], row["latitude_deg"])
            west, south, east, north = column["bbox"]
            assert west <= longitude <= east
            assert south <= latitude <= north
        bare = read.drop_columns(["geometry"]).to_pylist()
        assert bare == ask(archive, f"select * from {path.stem}").to_pylist()


def test_a_wrong_format_or_flight_is_named(searched: tuple[Path, Path], tmp_path: Path) -> None:
    archive, _ = searched
    with pytest.raises(UsageError, match="no format geotiff"):
        export_archive(archive, tmp_path, ["geotiff"])
    with pytest.raises(UsageError, match="no flight nowhere"):
        export_archive(archive, tmp_path, ["csv"], ["nowhere"])
