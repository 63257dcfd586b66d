"""A map with odd facts concerns only itself: it is read, or named with its fault."""

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from sql import write_mbtiles

from uavrt.analysis.inputs.map_files import maps_in, read_map
from uavrt.core.errors import FormatError
from uavrt.ground.page_listeners import encode
from uavrt.ground.web.routes.map_routes import map_list

ODD = (None, "", "a,b,c,d", "1,2,3", "nan,nan,nan,nan", "0,-91,1,91", b"\xff\xfe", -1, 1e999)


def write_map(path: Path, facts: Mapping[str, object], zoom: object = 3) -> Path:
    """Write an MBTiles file with one tile."""
    write_mbtiles(path, facts, [(zoom, 4, 4, b"\x89PNG")])
    return path


GOOD = {"name": "map", "format": "png", "bounds": "5,45,10,48", "attribution": "someone"}


@pytest.mark.parametrize("value", ODD)
@pytest.mark.parametrize("name", [*GOOD, None])
def test_one_odd_map_spoils_neither_the_list_nor_the_reports_map(
    tmp_path: Path, name: str | None, value: object
) -> None:
    write_map(tmp_path / "a good one.mbtiles", GOOD)
    facts: dict[Any, object] = {**GOOD, name: value}
    write_map(tmp_path / "odd.mbtiles", facts)
    listed = {one["name"]: one for one in map_list(tmp_path)}
    assert listed["a good one.mbtiles"]["fault"] is None
    odd = listed["odd.mbtiles"]
    assert odd["fault"] is not None or all(abs(edge) <= 180.1 for edge in odd["bounds"])
    encode(list(listed.values()))
    assert tmp_path / "a good one.mbtiles" in [one.path for one in maps_in(tmp_path)]


@pytest.mark.parametrize("zoom", ODD)
def test_a_map_with_an_odd_zoom_is_refused_or_read(tmp_path: Path, zoom: object) -> None:
    path = write_map(tmp_path / "odd.mbtiles", GOOD, zoom)
    with suppress(FormatError):
        assert isinstance(read_map(path).min_zoom, int)


def test_a_map_without_facts_or_with_unknown_ones_is_the_whole_world(tmp_path: Path) -> None:
    path = write_map(tmp_path / "bare.mbtiles", {"bounds": None, "attribution": None})
    assert read_map(path).bounds == (-180.0, -85.0, 180.0, 85.0)
    assert read_map(path).credit == "bare.mbtiles"


@pytest.mark.parametrize("suffix", ["pmtiles", "mbtiles"])
def test_a_pipe_or_a_folder_in_a_maps_place_is_named(tmp_path: Path, suffix: str) -> None:
    os.mkfifo(tmp_path / f"pipe.{suffix}")
    (tmp_path / f"folder.{suffix}").mkdir()
    faults = {one["name"]: one["fault"] for one in map_list(tmp_path)}
    assert all("the path is not a file" in fault for fault in faults.values())
    assert len(faults) == 2
