"""``--dem`` of localize and integrate: what the ground changes, and what it cannot tell."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.unit.analysis.conftest import WriteFlight

from uavrt.cli.options.placing_options import Placing
from uavrt.cli.results.export import export
from uavrt.cli.results.localize import localize
from uavrt.core.errors import FormatError, UsageError
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.whole_flight.tag_places import places_around
from uavrt_experiments.search.terrain import PLANE, elevation_of

HOME = (35.178241, -111.656587)


def write_tile(folder: Path, *, amsl_m: float = 2107.0, name: str = "N35W112") -> Path:
    heights = np.full((1201, 1201), amsl_m).astype(">i2")
    path = folder / f"{name}.hgt"
    path.write_bytes(heights.tobytes())
    return path


def cautions(capsys: pytest.CaptureFixture[str]) -> list[str]:
    records = json.loads(capsys.readouterr().out)
    return [one["text"] for record in records for one in record["cautions"]]


def test_level_ground_changes_nothing_and_wrong_ground_is_named(
    write_flight: WriteFlight, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = write_flight(tags=2, heard=1)
    localize(flight, place=Placing(antenna="monopole"), as_json=True)
    without = json.loads(capsys.readouterr().out)
    assert without
    localize(flight, place=Placing(antenna="monopole", dem=write_tile(tmp_path)), as_json=True)
    (told,) = json.loads(capsys.readouterr().out)
    assert not [one for one in told["cautions"] if one["name"] == "ground"]
    localize(
        flight,
        place=Placing(antenna="monopole", dem=write_tile(tmp_path, amsl_m=2076.0)),
        as_json=True,
    )
    assert any("datums differ" in text for text in cautions(capsys))
    elsewhere = write_tile(tmp_path, name="N47E008")
    localize(flight, place=Placing(antenna="monopole", dem=elsewhere), as_json=True)
    records = json.loads(capsys.readouterr().out)
    assert records[0]["latitude_deg"] == without[0]["latitude_deg"]
    assert "do not cover the flight" in records[0]["cautions"][-1]["text"]


def test_an_export_has_the_positions_over_the_same_ground_as_localize(
    write_flight: WriteFlight, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = write_flight(tags=2, heard=1)
    tile = write_tile(tmp_path, amsl_m=2076.0)
    localize(flight, place=Placing(antenna="monopole", dem=tile), as_json=True)
    (told,) = json.loads(capsys.readouterr().out)
    export(
        flight,
        formats=["geojson"],
        place=Placing(antenna="monopole", dem=tile),
        output=tmp_path / "out",
    )
    (path,) = (Path(line) for line in capsys.readouterr().out.splitlines())
    places = [
        one["geometry"]["coordinates"][:2]
        for one in json.loads(path.read_text())["features"]
        if "may_be_farther_out" in one["properties"] and one["geometry"]["type"] == "Point"
    ]
    assert places == [pytest.approx([told["longitude_deg"], told["latitude_deg"]], abs=1e-6)]
    with pytest.raises(FormatError, match="there is no"):
        export(flight, place=Placing(dem=tmp_path / "nothing.hgt"), output=tmp_path / "none")


def test_a_cut_off_tile_is_named_before_anything_is_computed(
    write_flight: WriteFlight, tmp_path: Path
) -> None:
    flight = write_flight(tags=2, heard=1)
    tile = write_tile(tmp_path)
    tile.write_bytes(tile.read_bytes()[:-10])
    with pytest.raises(FormatError, match="truncated"):
        localize(flight, place=Placing(dem=tile))


def test_bearings_without_heights_are_not_put_over_hills(tmp_path: Path) -> None:
    table = tmp_path / "bearings.csv"
    table.write_text("2,x.csv,10.0,0.9,47.0,8.0,450.0,1000.0,1.0,2.0\n")
    with pytest.raises(UsageError, match="has no flight heights"):
        localize(table, place=Placing(dem=write_tile(tmp_path)))


def test_a_whole_flight_weighs_places_by_what_a_ridge_takes() -> None:
    def ridge(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
        return np.asarray(400.0 + 80.0 * np.exp(-(((east_m - 300.0) / 60.0) ** 2)))

    count = 60
    north_m = np.linspace(-600.0, 600.0, count)
    latitude, longitude = PLANE.to_geodetic(np.full(count, 0.0), north_m)
    poses = PoseColumns(
        time_ns=np.arange(count) * 2_000_000_000,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.where(np.abs(north_m) < 100.0, 120.0, 30.0),
        quaternion_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
    )
    hills = HillLosses(
        elevation_of(ridge, reach_m=6000.0),
        latitude_deg=float(latitude[0]),
        longitude_deg=float(longitude[0]),
    )
    level, over = (
        places_around(poses, PATTERNS["RA-23K"], start_ns=0, end_ns=118_000_000_000, hills=one)
        for one in (None, hills)
    )
    distance = np.hypot(level.east_m, level.north_m)
    behind = np.argmin(np.hypot(level.east_m - 800.0, level.north_m)).item()
    before = np.argmin(np.hypot(level.east_m + 800.0, level.north_m)).item()
    assert distance[behind] == pytest.approx(distance[before])
    high = np.interp(level.time_s, poses.time_ns / 1e9, poses.height_m) > 110.0
    # From behind the ridge the pulses at 120 m stand out; from the other side they do not.
    share = [
        one.gain[behind, ~high].mean() / one.gain[behind, high].mean() for one in (level, over)
    ]
    assert share[1] < 0.3 * share[0]
    assert over.gain[before] == pytest.approx(level.gain[before], abs=0.1)
