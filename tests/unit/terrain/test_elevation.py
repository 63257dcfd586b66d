"""Heights of the ground from tiles and GeoTIFF, with their voids, borders and damages."""

import io
import struct
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin
from some import some

from uavrt.core.earth.geodesy import utm
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError
from uavrt.localization.terrain.elevation_files import open_elevation
from uavrt.localization.terrain.squares import ground_grid

_Floats = NDArray[np.float64]


def slope(latitude: _Floats, longitude: _Floats) -> _Floats:
    """Ground that rises thrice as fast to the north as to the east: no flip looks alike."""
    return np.asarray(3000.0 * (latitude - 47.0) + 1000.0 * (longitude - 8.0) + 200.0)


def write_tile(folder: Path, south: int, west: int, side: int = 1201) -> NDArray[np.int16]:
    rows = south + 1 - np.arange(side)[:, None] / (side - 1)
    columns = west + np.arange(side)[None, :] / (side - 1)
    own = slope(rows, columns) if south > 0 else 300.0 * (rows + 1) + 100.0 * (columns + 72)
    heights = np.rint(own).astype(">i2")
    name = (
        f"{'N' if south >= 0 else 'S'}{abs(south):02}{'E' if west >= 0 else 'W'}{abs(west):03}"
    )
    (folder / f"{name}.hgt").write_bytes(heights.tobytes())
    return heights


def test_a_tile_tells_heights_between_its_points(tmp_path: Path) -> None:
    write_tile(tmp_path, 47, 8)
    elevation = open_elevation(tmp_path / "N47E008.hgt")
    latitude = np.array([47.1, 47.33337, 47.9, 47.0, 48.0])
    longitude = np.array([8.9, 8.25, 8.01, 8.0, 9.0])
    assert elevation.heights_m(latitude, longitude) == pytest.approx(
        slope(latitude, longitude), abs=0.51
    )
    assert elevation.datums == ("EGM96",)


def test_tiles_of_one_and_three_seconds_and_zipped_ones_are_read(tmp_path: Path) -> None:
    write_tile(tmp_path, -1, -72, side=3601)
    with zipfile.ZipFile(tmp_path / "S01W072.SRTMGL1.hgt.zip", "w") as archive:
        archive.write(tmp_path / "S01W072.hgt", "S01W072.hgt")
    plain = open_elevation(tmp_path / "S01W072.hgt").heights_m([-0.3], [-71.7])
    zipped = open_elevation(tmp_path / "S01W072.SRTMGL1.hgt.zip").heights_m([-0.3], [-71.7])
    assert plain[0] == zipped[0]
    assert plain[0] == pytest.approx(300.0 * 0.7 + 100.0 * 0.3, abs=0.51)


def _change(content: bytearray, local: int, central: int, value: bytes) -> None:
    """Change a field in both headers of a zip's one file."""
    content[local : local + len(value)] = value
    there = content.rfind(b"PK\1\2") + central
    content[there : there + len(value)] = value


@pytest.mark.parametrize("damage", ["encrypted", "unknown method", "LZMA", "cut"])
def test_a_zipped_tile_that_cannot_be_unpacked_is_named(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "N47E008.hgt.zip"
    packed = {"LZMA": zipfile.ZIP_LZMA, "cut": zipfile.ZIP_STORED}
    with zipfile.ZipFile(path, "w", packed.get(damage, zipfile.ZIP_DEFLATED)) as archive:
        archive.writestr("N47E008.hgt", bytes(1201 * 1201 * 2))
    content = bytearray(path.read_bytes())
    match damage:
        case "encrypted":
            _change(content, 6, 8, b"\1")
        case "unknown method":
            _change(content, 8, 10, b"\x63\0")
        case "LZMA":
            content[60:200] = bytes(140)
        case "cut":
            _change(content, 18, 20, struct.pack("<I", 10))
    path.write_bytes(content)
    with pytest.raises(FormatError, match="cannot be read"):
        open_elevation(path).heights_m([47.5], [8.5])


def test_no_border_shows_between_tiles(tmp_path: Path) -> None:
    for south, west in ((47, 8), (47, 9), (46, 8), (46, 9)):
        write_tile(tmp_path, south, west)
    elevation = open_elevation(tmp_path)
    longitude = np.linspace(8.99, 9.01, 101)
    latitude = np.linspace(46.99, 47.01, 101)
    found = elevation.heights_m(latitude[:, None], longitude[None, :])
    assert found == pytest.approx(slope(latitude[:, None], longitude[None, :]), abs=0.51)


def write_void(folder: Path, reach: int) -> None:
    """A tile whose middle, and so many points to each side, is unknown."""
    heights = write_tile(folder, 47, 8)
    heights[600 - reach : 601 + reach, 600 - reach : 601 + reach] = -32768
    (folder / "N47E008.hgt").write_bytes(heights.tobytes())


def test_a_void_is_unknown_and_no_sea_and_its_neighbours_are_not_dragged_down(
    tmp_path: Path,
) -> None:
    write_void(tmp_path, 0)
    elevation = open_elevation(tmp_path)
    step = 1 / 1200
    assert np.isnan(elevation.heights_m([47.5], [8.5]))[0]
    assert np.isnan(open_elevation(tmp_path, sea=True).heights_m([47.5], [8.5]))[0]
    beside = elevation.heights_m([47.5], [8.5 + 0.6 * step])[0]
    assert beside == pytest.approx(float(slope(np.array(47.5), np.array(8.5 + step))), abs=1.5)


def test_what_no_tile_covers_is_unknown_unless_it_is_told_to_be_sea(tmp_path: Path) -> None:
    write_tile(tmp_path, 47, 8)
    assert np.isnan(open_elevation(tmp_path).heights_m([50.0], [3.0]))[0]
    at_sea = open_elevation(tmp_path, sea=True).heights_m([50.0, 47.5], [3.0, 8.5])
    assert at_sea[0] == 0.0
    assert at_sea[1] == pytest.approx(2200.0, abs=1.0)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("N47E008.hgt", b"\0" * 1_000_000, "truncated"),
        ("heights.hgt", b"\0" * 2_884_802, "gives no position"),
        ("N47E008.hgt.zip", b"PK\x03\x04 nothing", "cannot be read"),
        ("ground.tif", b"II*\0", "truncated"),
        ("ground.tif", b"not a picture at all", "not a GeoTIFF"),
        ("readme.txt", b"", "contains no ground heights"),
    ],
)
def test_what_is_no_elevation_file_is_named_with_the_remedy(
    tmp_path: Path, name: str, content: bytes, says: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FormatError, match=says) as caught:
        open_elevation(tmp_path)
    assert caught.value.remedy


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="there is no"):
        open_elevation(tmp_path / "nowhere")


# --------------------------------------------------------------------------- GeoTIFF


GEOGRAPHIC = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326)


def write_tiff(
    path: Path,
    pixels: NDArray[np.generic],
    *,
    corner: tuple[float, float] = (8.0, 48.0),
    step: float = 0.01,
    keys: tuple[int, ...] = GEOGRAPHIC,
    compression: str | None = None,
    predictor: int = 1,
    nodata: str | None = None,
) -> None:
    """Write by another program's code."""
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[33550] = (step, step, 0.0)
    tags.tagtype[33550] = 12
    tags[33922] = (0.0, 0.0, 0.0, *corner, 0.0)
    tags.tagtype[33922] = 12
    if keys:
        tags[34735] = keys
        tags.tagtype[34735] = 3
    if predictor != 1:
        tags[317] = predictor
    if nodata is not None:
        tags[42113] = nodata
    Image.fromarray(pixels).save(path, compression=compression, tiffinfo=tags)


def geographic(rows: int = 100, columns: int = 100, step: float = 0.01) -> _Floats:
    latitude: _Floats = 48.0 - step * (np.arange(rows, dtype=np.float64)[:, None] + 0.5)
    longitude: _Floats = 8.0 + step * (np.arange(columns, dtype=np.float64)[None, :] + 0.5)
    return slope(latitude, longitude)


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_adobe_deflate", "packbits"])
@pytest.mark.parametrize("kind", ["f4", "i4", "u2"])
def test_packed_pictures_of_heights_are_read(
    tmp_path: Path, compression: str | None, kind: str
) -> None:
    write_tiff(tmp_path / "a.tif", geographic().astype(kind), compression=compression)
    elevation = open_elevation(tmp_path / "a.tif")
    latitude, longitude = np.array([47.22, 47.777, 47.99]), np.array([8.1, 8.5, 8.9])
    assert elevation.heights_m(latitude, longitude) == pytest.approx(
        slope(latitude, longitude), abs=1.01
    )
    assert elevation.datums == ("unknown",)


@pytest.mark.parametrize(("kind", "predictor"), [("u2", 2), ("i4", 2), ("f4", 3)])
@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate"])
def test_differences_of_neighbours_are_undone(
    tmp_path: Path, kind: str, predictor: int, compression: str
) -> None:
    pixels = geographic().astype(kind)
    write_tiff(tmp_path / "a.tif", pixels, compression=compression, predictor=predictor)
    found = open_elevation(tmp_path).heights_m([47.775], [8.505])[0]
    assert found == pytest.approx(float(pixels[22, 50]), abs=0.01)


def test_what_the_file_calls_nothing_is_unknown(tmp_path: Path) -> None:
    pixels = geographic().astype("f4")
    pixels[22, 50] = -9999.0
    write_tiff(tmp_path / "a.tif", pixels, nodata="-9999")
    found = open_elevation(tmp_path).heights_m([47.775, 47.665], [8.505, 8.505])
    assert np.isnan(found).tolist() == [True, False]


def test_pictures_beside_each_other_join_without_a_gap(tmp_path: Path) -> None:
    both = geographic(columns=200).astype("f4")
    write_tiff(tmp_path / "a.tif", both[:, :100])
    write_tiff(tmp_path / "b.tif", np.ascontiguousarray(both[:, 100:]), corner=(9.0, 48.0))
    longitude = np.linspace(8.98, 9.02, 41)
    found = open_elevation(tmp_path).heights_m(np.full(41, 47.5), longitude)
    assert found == pytest.approx(slope(np.full(41, 47.5), longitude), abs=0.1)


@pytest.mark.parametrize(("latitude", "epsg"), [(47.2, 32632), (-33.4, 32732)])
def test_heights_in_utm_stand_where_they_belong(
    tmp_path: Path, latitude: float, epsg: int
) -> None:
    middle = some(utm(latitude, 9.4))
    corner = (middle.easting_m - 5000.0, middle.northing_m + 5000.0)
    column, row = np.meshgrid(np.arange(1000) + 0.5, np.arange(1000) + 0.5)
    pixels = (0.3 * 10.0 * column - 0.7 * 10.0 * row).astype("f4") * 0.05 + 300.0
    keys = (1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, epsg)
    write_tiff(tmp_path / "a.tif", pixels, corner=corner, step=10.0, keys=keys)
    rng = np.random.default_rng(3)
    lat = latitude + rng.uniform(-0.03, 0.03, 50)
    lon = 9.4 + rng.uniform(-0.03, 0.03, 50)
    found = open_elevation(tmp_path).heights_m(lat, lon)
    for height, phi, lam in zip(found, lat, lon, strict=True):
        at = some(utm(float(phi), float(lam)))
        x, y = at.easting_m - corner[0], corner[1] - at.northing_m
        assert height == pytest.approx(0.05 * (0.3 * x - 0.7 * y) + 300.0, abs=0.02)


def test_tiles_within_a_file_are_put_together(tmp_path: Path) -> None:
    pixels = geographic(rows=70, columns=50).astype("<f4")
    padded = np.zeros((96, 64), "<f4")
    padded[:70, :50] = pixels
    tiles = [padded[r : r + 32, c : c + 32].tobytes() for r in (0, 32, 64) for c in (0, 32)]
    sizes = [len(tile) for tile in tiles]
    content = a_tiff(
        b"".join(tiles),
        t256=(4, (50,)),
        t257=(4, (70,)),
        t258=(3, (32,)),
        t273=None,
        t278=None,
        t279=None,
        t322=(4, (32,)),
        t323=(4, (32,)),
        t324=(4, tuple(8 + sum(sizes[:number]) for number in range(6))),
        t325=(4, tuple(sizes)),
        t339=(3, (3,)),
        t33550=(12, (0.01, 0.01, 0.0)),
        t33922=(12, (0.0, 0.0, 0.0, 8.0, 48.0, 0.0)),
    )
    (tmp_path / "a.tif").write_bytes(content)
    found = open_elevation(tmp_path).heights_m([47.555, 47.505], [8.455, 8.105])
    assert found == pytest.approx([pixels[44, 45], pixels[49, 10]], abs=0.01)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ((), "the coordinate system is missing"),
        ((1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2056), "EPSG:2056"),
        ((1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4267), "EPSG:4267"),
        ((1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 4099, 0, 1, 9003), "not in metres"),
    ],
)
def test_other_coordinates_are_named_with_the_command_that_turns_them(
    tmp_path: Path, keys: tuple[int, ...], says: str
) -> None:
    write_tiff(tmp_path / "a.tif", geographic().astype("f4"), keys=keys)
    with pytest.raises(FormatError, match=says) as caught:
        open_elevation(tmp_path)
    assert "gdal" in str(caught.value.remedy)


@pytest.mark.parametrize(
    ("more", "datum"),
    [
        ((4096, 0, 1, 5773), "EGM96"),
        ((4096, 0, 1, 3855), "EGM2008"),
        ((4096, 0, 1, 5030), "ellipsoid"),
        ((4096, 0, 1, 1234), "EPSG 1234"),
    ],
)
def test_what_heights_count_from_is_told(
    tmp_path: Path, more: tuple[int, ...], datum: str
) -> None:
    keys = (1, 1, 0, 4, *GEOGRAPHIC[4:], *more)
    write_tiff(tmp_path / "a.tif", geographic().astype("f4"), keys=keys)
    assert open_elevation(tmp_path).datums == (datum,)


def test_a_picture_that_was_cut_off_is_named(tmp_path: Path) -> None:
    write_tiff(tmp_path / "a.tif", geographic().astype("f4"))
    whole = (tmp_path / "a.tif").read_bytes()
    for share in (0.1, 0.5, 0.99):
        (tmp_path / "a.tif").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(FormatError, match=r"truncated|damaged"):
            open_elevation(tmp_path).heights_m([47.3], [8.3])


def test_damaged_bytes_never_end_in_another_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    write_tiff(tmp_path / "a.tif", geographic().astype("f4"), compression="tiff_lzw")
    whole = bytearray((tmp_path / "a.tif").read_bytes())
    read = 0
    for _ in range(300):
        broken = bytearray(whole)
        for _ in range(4):
            place = rng.integers(0, len(broken)) if rng.random() < 0.5 else rng.integers(0, 400)
            broken[int(place) % len(broken)] = int(rng.integers(0, 256))
        (tmp_path / "a.tif").write_bytes(broken)
        with suppress(FormatError):
            open_elevation(tmp_path).heights_m([47.3, 47.9], [8.3, 8.8])
            read += 1
    assert 0 < read < 300


def a_tiff(content: bytes = struct.pack("<4h", 1, 2, 3, 4), /, **changed: object) -> bytes:
    """Write a TIFF of 2 x 2 heights, with these tags (kind and values, or none) instead."""
    kinds = {3: "H", 4: "I", 12: "d"}
    tags: dict[int, Any] = {
        256: (4, (2,)),
        257: (4, (2,)),
        258: (3, (16,)),
        259: (3, (1,)),
        273: (4, (8,)),
        278: (4, (2,)),
        279: (4, (8,)),
        339: (3, (2,)),
        33550: (12, (0.5, 0.5, 0.0)),
        33922: (12, (0.0, 0.0, 0.0, 8.0, 47.0, 0.0)),
        34735: (3, (1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326)),
    }
    tags |= {int(name[1:]): value for name, value in changed.items()}
    tags = {tag: value for tag, value in sorted(tags.items()) if value is not None}
    table, extra = b"", content
    for tag, (kind, values) in tags.items():
        packed = struct.pack(f"<{len(values)}{kinds[kind]}", *values)
        if len(packed) > 4:
            extra, packed = extra + packed, struct.pack("<I", 8 + len(extra))
        table += struct.pack("<HHI", tag, kind, len(values)) + packed.ljust(4, b"\0")
    head = b"II" + struct.pack("<HI", 42, 8 + len(extra)) + extra
    return head + struct.pack("<H", len(tags)) + table + bytes(4)


def test_a_picture_written_by_hand_is_read(tmp_path: Path) -> None:
    path = tmp_path / "some.tif"
    path.write_bytes(a_tiff())
    assert open_elevation(path).heights_m([46.75], [8.25]) == [1.0]


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"t33922": (12, (0.0, 0.0, 0.0, float("nan"), 47.0, 0.0))}, "origin nan"),
        ({"t33550": (12, (1e-300, 1e-300, 0.0))}, "or step"),
        ({"t273": (12, (8.0,))}, "damaged"),
        ({"t279": (12, (8.0,))}, "damaged"),
        ({"t34735": (3, (1,))}, "EPSG:0"),
        ({"t256": (4, (19000,)), "t257": (4, (19000,)), "t278": (4, (19000,))}, "too large"),
    ],
)
def test_tags_that_cannot_be_are_refused(
    tmp_path: Path, changed: dict[str, object], says: str
) -> None:
    path = tmp_path / "some.tif"
    path.write_bytes(a_tiff(**changed))
    with pytest.raises(FormatError, match=says):
        open_elevation(path).heights_m([46.75], [8.25])


def test_tags_that_are_not_read_cost_nothing(tmp_path: Path) -> None:
    path = tmp_path / "some.tif"
    content = a_tiff(t1000=(3, (7,)))
    entry = content.index(struct.pack("<HHI", 1000, 3, 1))
    beyond = struct.pack("<HHII", 1000, 3, 900_000, len(content))  # there is nothing
    path.write_bytes(content[:entry] + beyond + content[entry + 12 :])
    assert open_elevation(path).heights_m([46.75], [8.25]) == [1.0]


def test_squares_around_a_place_have_the_grounds_heights(tmp_path: Path) -> None:
    write_tile(tmp_path, 47, 8)
    plane = TangentPlane(latitude_deg=47.5, longitude_deg=8.5)
    area = {"west_m": -300.0, "east_m": 500.0, "south_m": -200.0, "north_m": 400.0}
    grid = ground_grid(open_elevation(tmp_path), plane, cell_m=10.0, **area)
    assert grid.height_m.shape == (61, 81)
    east, north = np.array([-123.0, 444.0]), np.array([50.0, 333.0])
    expected = slope(*plane.to_geodetic(east, north))
    assert grid(east, north) == pytest.approx(expected, abs=0.6)
    assert grid.unknown_share == 0.0


def test_squares_over_a_void_are_told_from_the_others(tmp_path: Path) -> None:
    write_void(tmp_path, 2)
    plane = TangentPlane(latitude_deg=47.5, longitude_deg=8.5)
    area = {"west_m": -1000.0, "east_m": 1000.0, "south_m": -1000.0, "north_m": 1000.0}
    grid = ground_grid(open_elevation(tmp_path), plane, cell_m=20.0, **area)
    assert not grid.known[50, 50]
    assert 0.02 < grid.unknown_share < 0.06
    assert grid.height_m[50, 50] == pytest.approx(2200.0, abs=20.0)


def test_a_picture_in_memory_of_the_exporter_is_read_back(tmp_path: Path) -> None:
    """The map that a report exports is a GeoTIFF, too."""
    from uavrt.analysis.export.geotiff_export import geotiff_bytes
    from uavrt.localization.results import PositionGrid

    axis = np.arange(-500.0, 501.0, 20.0)
    values = np.add.outer(0.1 * axis, 0.03 * axis) + 100.0
    grid = PositionGrid(
        latitude_deg=47.5, longitude_deg=8.5, east_m=axis, north_m=axis, probability=values
    )
    (tmp_path / "a.tif").write_bytes(io.BytesIO(geotiff_bytes(grid, "heights")).getvalue())
    plane = TangentPlane(latitude_deg=47.5, longitude_deg=8.5)
    found = open_elevation(tmp_path).heights_m(
        *plane.to_geodetic(np.array([123.0]), np.array([-77.0]))
    )
    assert found[0] == pytest.approx(100.0 - 7.7 + 3.69, abs=0.1)


@pytest.mark.parametrize("keys", [(4096, 0, 1, 5030), (4096, 0, 1, 3855), ()])
def test_tiles_of_one_datum_beside_a_picture_of_another_are_no_silent_cliff(
    tmp_path: Path, keys: tuple[int, ...]
) -> None:
    write_tile(tmp_path, 47, 8)
    more = (1, 1, 0, 4, *GEOGRAPHIC[4:], *keys) if keys else GEOGRAPHIC
    write_tiff(tmp_path / "a.tif", geographic().astype("f4"), keys=more)
    if 5030 in keys:
        with pytest.raises(
            FormatError, match=r"mixes height datums: that of a[.]tif is the ellips"
        ):
            open_elevation(tmp_path)
        return
    elevation = open_elevation(tmp_path)
    (caution,) = elevation.cautions
    assert "EGM96" in caution
    assert open_elevation(tmp_path / "N47E008.hgt").cautions == ()
