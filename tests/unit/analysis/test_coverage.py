"""Maps of where a tag is heard, by the command: of plans, and of flights over hills."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from depth import share
from tests.unit.analysis.conftest import WriteFlight

from uavrt.cli.prediction.coverage import coverage
from uavrt.cli.results.report import report
from uavrt.config.settings import Settings
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import ConfigError, FormatError, UsageError
from uavrt.localization.terrain.elevation_files import open_elevation
from uavrt.simulation.scene.scenario_file import load_scenario
from uavrt.simulation.scene.world import World

HOME = (35.178241, -111.656587)


def write_hills(folder: Path, *, amsl_m: float = 2107.0) -> Path:
    """A tile around the demo's home with a ridge 900 m to the east of it."""
    side = 1201
    east_m = (np.arange(side) / (side - 1) - (HOME[1] + 112.0)) * 90_900.0
    ridge = 150.0 * np.exp(-(((east_m - 900.0) / 150.0) ** 2))
    heights = np.broadcast_to(amsl_m + ridge, (side, side)).astype(">i2")
    (folder / "N35W112.hgt").write_bytes(heights.tobytes())
    return folder


def outline(path: Path, west_m: float, east_m: float, reach_m: float = 300.0) -> Path:
    plane = TangentPlane(latitude_deg=HOME[0], longitude_deg=HOME[1])
    corners = [(west_m, -reach_m), (east_m, -reach_m), (east_m, reach_m), (west_m, reach_m)]
    ring = []
    for east, north in [*corners, corners[0]]:
        latitude, longitude = plane.to_geodetic(east, north)
        ring.append([float(longitude), float(latitude)])
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


Told = Callable[..., list[dict[str, Any]]]


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Run `uavrt coverage`; what it tells other programs."""

    def run(what: Path, **options: Any) -> list[dict[str, Any]]:
        capsys.readouterr()
        coverage(what, as_json=True, **options)
        records: list[dict[str, Any]] = json.loads(capsys.readouterr().out)
        return records

    return run


def test_a_plan_over_hills_is_mapped_for_several_heights(tmp_path: Path, told: Told) -> None:
    hills = write_hills(tmp_path)
    plan = outline(tmp_path / "area.geojson", -300.0, 300.0)
    beyond = outline(tmp_path / "beyond.geojson", 1200.0, 1600.0)
    usual = {"tag_power": -50.0, "area": beyond, "cell": 50.0, "margin": 1500.0}
    low, high = told(plan, **usual, dem=hills, height=(30.0, 110.0), output=tmp_path / "maps")
    assert (low["height_m"], high["height_m"]) == (30.0, 110.0)
    assert high["best"]
    assert not low["best"]
    assert low["mean_probability"] < high["mean_probability"]
    assert low["limitations"] == []
    # The GeoTIFF stands where the map is, and is dark behind the ridge.
    raster = open_elevation(tmp_path / "maps" / "coverage_tag_2_30m.tif")
    plane = TangentPlane(latitude_deg=HOME[0], longitude_deg=HOME[1])
    near, behind = raster.heights_m(*plane.to_geodetic([400.0, 1400.0], [0.0, 0.0]))
    assert near > 0.9
    assert behind < 0.3
    picture = (tmp_path / "maps" / "coverage_tag_2_30m.png").read_bytes()
    assert picture[:4] == b"\x89PNG"
    # With axes, scale and colours beside the map, at a size that can be read.
    assert int.from_bytes(picture[16:20], "big") >= 1000
    (level,) = told(plan, **usual, height=(30.0,))
    assert level["area_probability"] > low["area_probability"] + 0.1
    assert "level" in str(level["limitations"])


def test_a_flight_tells_where_a_silent_tag_is_not(
    write_flight: WriteFlight, tmp_path: Path, told: Told
) -> None:
    flight = write_flight(tags=2, heard=1)
    hills = write_hills(tmp_path)
    here = outline(tmp_path / "here.geojson", -100.0, 300.0)
    beyond = outline(tmp_path / "beyond.geojson", 1300.0, 1800.0)
    found = {}
    for area in (here, beyond):
        heard, silent = told(
            flight, tag_power=-50.0, dem=hills, area=area, prior=0.5, cell=50.0
        )
        assert heard["heard_pulses"] > 10
        assert heard["not_here"] is None
        found[area.stem] = silent["not_here"]
    assert found["here"] > 0.95
    assert 0.5 <= found["beyond"] < 0.75


def test_elevation_files_of_another_place_are_a_limitation_and_no_zero(
    write_flight: WriteFlight, tmp_path: Path, told: Told
) -> None:
    flight = write_flight(tags=2, heard=1)
    write_hills(tmp_path)
    (tmp_path / "N35W112.hgt").rename(tmp_path / "N47E008.hgt")
    records = told(flight, tag_power=-50.0, dem=tmp_path, cell=50.0)
    assert len(records) == 2
    for record in records:
        assert "do not cover the flight path" in str(record["limitations"])
        assert record["mean_probability"] > 0.1


def test_shares_and_area_are_of_the_ground_that_is_known(
    tmp_path: Path, told: Told, capsys: pytest.CaptureFixture[str]
) -> None:
    side, void = 3601, -32768
    heights = np.full((side, side), void, ">i2")
    row, column = round((36.0 - HOME[0]) * 3600), round((HOME[1] + 112.0) * 3600)
    heights[row - 20 : row + 21, column - 20 : column + 21] = 2107  # 1.26 km by 1.03 km
    (tmp_path / "N35W112.hgt").write_bytes(heights.tobytes())
    plan = outline(tmp_path / "area.geojson", -200.0, 200.0)
    usual: dict[str, Any] = {
        "tag_power": -25.0,
        "dem": tmp_path,
        "height": (60.0,),
        "cell": 50.0,
    }
    (record,) = told(plan, **usual)
    assert record["unknown_share"] == pytest.approx(0.93, abs=0.05)
    assert record["share90"] == 1.0
    assert record["map_km2"] == pytest.approx(1.3, abs=0.2)
    coverage(plan, **usual)
    assert f"on 100 % of {record['map_km2']:.1f} km²" in capsys.readouterr().out


def test_another_datum_is_named(write_flight: WriteFlight, tmp_path: Path, told: Told) -> None:
    flight = write_flight(tags=2, heard=1)
    hills = write_hills(tmp_path, amsl_m=2107.0 - 31.0)
    first, _ = told(flight, tag_power=-50.0, dem=hills, cell=50.0)
    assert "datums differ" in str(first["limitations"])


def test_a_cut_off_tile_and_a_file_without_places_are_named(tmp_path: Path) -> None:
    plan = outline(tmp_path / "area.geojson", -300.0, 300.0)
    write_hills(tmp_path)
    tile = tmp_path / "N35W112.hgt"
    tile.write_bytes(tile.read_bytes()[:-10])
    with pytest.raises(FormatError, match="truncated"):
        coverage(plan, tag_power=-50.0, dem=tmp_path)
    tile.unlink()
    with pytest.raises(FormatError, match="no ground heights"):
        coverage(plan, tag_power=-50.0, dem=tmp_path)
    (tmp_path / "other.kml").write_text("<kml></kml>")
    with pytest.raises(FormatError, match="contains no usable area"):
        coverage(tmp_path / "other.kml", tag_power=-50.0)
    for west_m, east_m, says in (
        (30_000.0, 31_000.0, r"lies 2\d,\d\d\d m beyond the map"),
        (3e6, 3.001e6, r"km beyond the map.*not swapped"),
        (3.0, 4.0, "no map cell"),
    ):
        area = outline(tmp_path / "other.geojson", west_m, east_m)
        with pytest.raises(UsageError, match=says):
            coverage(plan, tag_power=-50.0, area=area)
    with pytest.raises(ConfigError, match="--sea has no effect without elevation files"):
        coverage(plan, tag_power=-50.0, sea=True)
    (tmp_path / "pictures").mkdir()
    for content in (b"", b"no picture", b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x01"):
        (tmp_path / "pictures" / "a.tif").write_bytes(content)
        with pytest.raises(
            FormatError, match=r"truncated: the (TIFF tags|file does not begin)"
        ):
            coverage(plan, tag_power=-50.0, dem=tmp_path / "pictures")


def test_a_scenario_file_flies_over_hills(tmp_path: Path) -> None:
    """A ridge between drone and tag: the simulated world has its shadow."""
    write_hills(tmp_path)
    text = """
        [terrain]
        dem = "N35W112.hgt"
        [flight]
        height_m = 60.0
        [[tag]]
        tag_id = 2
        frequency_hz = 148.71e6
        pulse_width_s = 0.02
        pulse_intervals_s = [1.254]
        east_m = 1400.0
    """
    (tmp_path / "hills.toml").write_text(text)
    (tmp_path / "level.toml").write_text(text.replace('dem = "N35W112.hgt"', ""))
    levels = []
    for name in ("hills.toml", "level.toml"):
        scenario = load_scenario(tmp_path / name)
        levels.append(World(scenario).pulse(scenario.tag[0], 0).enr_db)
    assert levels[0] < levels[1] - 15.0


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("antenna", share(["H3", None], 2))
def test_the_flights_own_antenna_is_that_of_report_and_command(
    write_flight: WriteFlight,
    tmp_path: Path,
    told: Told,
    capsys: pytest.CaptureFixture[str],
    antenna: str | None,
) -> None:
    settings = None
    if antenna is not None:
        own = replace(Settings().bearings, antenna=antenna)
        settings = replace(Settings(), bearings=own)
    flight = write_flight(tags=1, heard=1, settings=settings)
    (said,) = told(flight, tag_power=-60.0)
    assert said["antenna"] == (antenna or "RA-23K")
    coverage(flight, tag_power=-60.0, antenna="monopole")
    whip = capsys.readouterr().out
    assert "antenna: monopole, alike on all sides" in whip
    mean = said["mean_probability"]
    assert f"{100.0 * mean:.0f} % on average" not in whip
    report(flight, tag_power=-60.0, pdf=False, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert f"with {100.0 * mean:.0f} % on average" in page
    assert f"<dt>Antenna</dt><dd>{said['antenna']}</dd>" in page


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"tag": (99,)}, "Name the tag file with --tags"),
        ({"prior": 0.5}, "name the flight's directory"),
    ],
)
def test_what_says_nothing_before_a_flight_is_refused(
    tmp_path: Path, options: dict[str, Any], says: str
) -> None:
    plan = outline(tmp_path / "area.geojson", -300.0, 300.0)
    with pytest.raises(ConfigError) as caught:
        coverage(plan, tag_power=-50.0, cell=100.0, **options)
    assert says in str(caught.value.remedy)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"prior": 0.5}, "--area"),
        ({"height": (80.0,)}, "Leave --height out"),
        ({"frequency": 173e6}, "Leave --frequency out"),
    ],
)
def test_what_says_nothing_after_a_flight_is_refused(
    write_flight: WriteFlight, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        coverage(write_flight(tags=1), tag_power=-50.0, **options)
    assert says in str(caught.value.remedy)
