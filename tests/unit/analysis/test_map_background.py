"""A map under the flight of a report, from files that others made."""

import contextlib
import gzip
import io
import json
import math
import shutil
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import Ran
from matplotlib.figure import Figure
from PIL import Image
from report_text import said_in_report
from some import some
from sql import write_mbtiles

from uavrt.analysis.inputs.map_files import MapFile, maps_in, read_map, tile_place
from uavrt.analysis.report.report_maps import draw_overview
from uavrt.analysis.survey import Survey, read_survey
from uavrt.core.errors import FormatError

CREDIT = "© OpenStreetMap contributors"
ZOOM = 14
PLACE = (46.5, 8.0)


def picture(colour: tuple[int, int, int]) -> bytes:
    stream = io.BytesIO()
    Image.new("RGB", (256, 256), colour).save(stream, "PNG")
    return stream.getvalue()


def colour_of(column: int, row: int) -> tuple[int, int, int]:
    return (200, 10 * (column % 20), 10 * (row % 20))


def around(latitude: float, longitude: float) -> list[tuple[int, int]]:
    """Columns and rows around a place."""
    column, row = (math.floor(value) for value in tile_place(latitude, longitude, ZOOM))
    return [(column + a, row + b) for a in range(-3, 4) for b in range(-3, 4)]


def write_map(path: Path, latitude: float, longitude: float) -> MapFile:
    bounds = f"{longitude - 0.05},{latitude - 0.05},{longitude + 0.05},{latitude + 0.05}"
    facts = {"format": "png", "bounds": bounds, "attribution": f"<a>{CREDIT}</a>"}
    tiles = [
        (ZOOM, column, 2**ZOOM - 1 - row, picture(colour_of(column, row)))
        for column, row in around(latitude, longitude)
    ]
    write_mbtiles(path, facts, tiles)
    return read_map(path)


def varints(*values: int) -> bytes:
    found = bytearray()
    for value in values:
        while value > 127:
            found.append(value & 127 | 128)
            value >>= 7
        found.append(value)
    return bytes(found)


def hilbert(z: int, x: int, y: int) -> int:
    """By the recursion of the curve, not by its bits."""
    if z == 0:
        return 0
    half = 1 << (z - 1)
    quarter = half * half
    if x < half and y < half:
        return hilbert(z - 1, y, x)
    if x < half:
        return quarter + hilbert(z - 1, x, y - half)
    if y >= half:
        return 2 * quarter + hilbert(z - 1, x - half, y - half)
    return 3 * quarter + hilbert(z - 1, half - 1 - y, 2 * half - 1 - x)


def write_pmtiles(path: Path, latitude: float, longitude: float) -> MapFile:
    """With a leaf directory, everything packed but the tiles."""
    base = (4**ZOOM - 1) // 3
    tiles = sorted(
        (base + hilbert(ZOOM, column, row), picture(colour_of(column, row)))
        for column, row in around(latitude, longitude)
    )
    ids = [number for number, _ in tiles]
    steps = [ids[0], *np.diff(ids).tolist()]
    lengths = [len(content) for _, content in tiles]
    leaf = gzip.compress(
        varints(len(ids), *steps, *[1] * len(ids), *lengths, 1, *[0] * (len(ids) - 1))
    )
    root = gzip.compress(varints(1, ids[0], 0, len(leaf), 1))
    facts = gzip.compress(json.dumps({"attribution": CREDIT}).encode())
    begin = 127
    place = [begin, len(root), begin + len(root), len(facts)]
    leaves = begin + len(root) + len(facts)
    header = b"PMTiles\x03" + struct.pack(
        "<11Q", *place, leaves, len(leaf), leaves + len(leaf), sum(lengths), 0, 0, 0
    )
    header += struct.pack("<6B", 1, 2, 1, 2, ZOOM, ZOOM)
    edges = (longitude - 0.05, latitude - 0.05, longitude + 0.05, latitude + 0.05)
    header += struct.pack("<4iB2i", *(round(edge * 1e7) for edge in edges), ZOOM, 0, 0)
    path.write_bytes(header + root + facts + leaf + b"".join(content for _, content in tiles))
    return read_map(path)


WRITERS = pytest.mark.parametrize("write", [write_map, write_pmtiles])


@WRITERS
def test_a_tile_is_found_where_it_lies(
    write: Callable[[Path, float, float], MapFile], tmp_path: Path
) -> None:
    made = write(tmp_path / f"valley.{write.__name__[6:]}", *PLACE)
    assert made.credit == CREDIT
    assert made.tiles == "png"
    for column, row in around(*PLACE):
        content = some(made.tile(ZOOM, column, row))
        pixel = Image.open(io.BytesIO(content)).getpixel((5, 5))
        assert pixel == colour_of(column, row)
    assert made.tile(ZOOM, 3, 3) is None
    assert made.tile(ZOOM - 1, 3, 3) is None


@pytest.fixture(scope="module")
def survey(write_flight: Callable[..., Path]) -> Survey:
    return read_survey(write_flight(tags=1))


@WRITERS
def test_the_map_of_a_report_lies_under_the_flight_and_says_whose_it_is(
    write: Callable[[Path, float, float], MapFile], survey: Survey, tmp_path: Path
) -> None:
    start = survey.track[0]
    here = (start.latitude_deg, start.longitude_deg)
    made = write(tmp_path / f"valley.{write.__name__[6:]}", *here)
    figure = Figure(figsize=(6.0, 6.0), dpi=100)
    draw_overview(figure, replace(survey, maps=(made,)))
    (axes,) = figure.axes
    (image,) = axes.images
    left, right, low, high = image.get_extent()
    assert left <= axes.get_xlim()[0] < axes.get_xlim()[1] <= right
    assert low <= axes.get_ylim()[0] < axes.get_ylim()[1] <= high
    # The pixel at the start, which is the axes' origin, is its tile's colour, paler.
    pixels = np.asarray(image.get_array())
    column = int((0.0 - left) / (right - left) * pixels.shape[1])
    row = int((high - 0.0) / (high - low) * pixels.shape[0])
    tile = [math.floor(value) for value in tile_place(*here, ZOOM)]
    expected = 0.5 + 0.5 * np.array(colour_of(tile[0], tile[1])) / 255.0
    assert pixels[row, column] == pytest.approx(expected, abs=0.01)
    assert CREDIT in [text.get_text() for text in axes.texts]
    assert CREDIT in said_in_report(replace(survey, maps=(made,)))


def test_without_a_map_of_this_place_nothing_is_drawn_and_nothing_said(
    survey: Survey, tmp_path: Path
) -> None:
    start = survey.track[0]
    elsewhere = write_map(
        tmp_path / "elsewhere.mbtiles", start.latitude_deg + 1.0, start.longitude_deg
    )
    figure = Figure(figsize=(6.0, 6.0))
    draw_overview(figure, replace(survey, maps=(elsewhere,)))
    assert len(figure.axes[0].images) == 0


@pytest.mark.usefixtures("undrawn")
def test_the_command_takes_maps_beside_the_flight(
    write_flight: Callable[..., Path], survey: Survey, tmp_path: Path, ran: Ran
) -> None:
    flight = shutil.copytree(write_flight(tags=1), tmp_path / "flight_log_x")
    (tmp_path / "maps").mkdir()
    start = survey.track[0]
    write_map(tmp_path / "maps" / "valley.mbtiles", start.latitude_deg, start.longitude_deg)
    (tmp_path / "maps" / "broken.pmtiles").write_bytes(b"PMTiles\x03" + bytes(40))
    ran("report", flight, "--no-pdf")
    assert CREDIT in (flight / "report.html").read_text("utf-8")


def test_what_is_no_map_and_what_was_damaged_is_named(tmp_path: Path) -> None:
    broken = tmp_path / "broken.pmtiles"
    broken.write_bytes(b"nothing of the kind")
    with pytest.raises(FormatError, match="not PMTiles version 3"):
        read_map(broken)
    made = write_pmtiles(tmp_path / "valley.pmtiles", *PLACE)
    content = bytearray(made.path.read_bytes())
    far = content[:106] + struct.pack("<i", 2_000_000_000) + content[110:]
    for damaged, says in (
        (content[:-1], "incomplete or damaged"),
        (far, "not positions on earth"),
    ):
        made.path.write_bytes(damaged)
        with pytest.raises(FormatError, match=says):
            read_map(made.path)


def test_an_index_in_another_compression_is_refused_with_a_way_out(tmp_path: Path) -> None:
    made = write_pmtiles(tmp_path / "valley.pmtiles", *PLACE)
    content = made.path.read_bytes()
    made.path.write_bytes(content[:97] + b"\x04" + content[98:])  # zstd
    column, row = tile_place(*PLACE, ZOOM)
    with pytest.raises(FormatError, match="compression other than gzip") as refused:
        read_map(made.path).tile(ZOOM, int(column), int(row))
    assert refused.value.remedy == "Convert the map to MBTiles, or write its index with gzip"
    rng = np.random.default_rng(4)
    for _ in range(300):
        damaged = bytearray(content)
        for place in rng.integers(8, 400, 4):
            damaged[place] = int(rng.integers(256))
        made.path.write_bytes(damaged)
        with contextlib.suppress(FormatError):
            read_map(made.path).tile(ZOOM, *around(*PLACE)[0])
    assert maps_in(tmp_path / "nowhere") == ()
