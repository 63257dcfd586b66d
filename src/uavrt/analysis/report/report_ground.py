"""Draw a background map from a local map file, without downloading anything."""

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.inputs.map_files import MapFile, tile_corner, tile_place
from uavrt.analysis.report.style import SOFT
from uavrt.analysis.survey import Survey
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TILES_ACROSS = 3.0
"""Target number of map tiles across a picture, at most four a side: 1 to 2 MB."""
MOST_SIDE = 1024
_PALE = 0.5
"""Opacity of the white layer over the background map, which keeps lines readable."""

_Pixels = NDArray[np.float64]


def draw_ground(axes: "Axes", plane: TangentPlane, maps: Sequence[MapFile]) -> None:
    """Draw the most detailed map that covers the axes, with its attribution; Web Mercator is
    stretched to metres, with an error of a few metres over 4 km.
    """
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    (south, north), (west, east) = plane.to_geodetic([left, right], [low, high])
    holding = [one for one in maps if one.covers(west, south, east, north)]
    for one in sorted(holding, key=lambda each: -each.max_zoom):
        try:
            picture = _picture(one, (west, south, east, north))
        except FormatError:
            continue
        if picture is None:
            continue
        pixels, (top, first, bottom, last) = picture
        (x0, x1), (y1, y0) = plane.to_local([top, bottom], [first, last])
        axes.imshow(
            pixels, extent=(x0, x1, y0, y1), zorder=0, interpolation="bilinear", aspect="equal"
        )
        axes.annotate(
            one.credit,
            xy=(1.0, 0.0),
            xycoords="axes fraction",
            xytext=(-2, 2),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=6,
            color=SOFT,
            bbox={"facecolor": "white", "alpha": 0.8, "lw": 0, "pad": 1.0},
            zorder=7,
        )
        return


def maps_under(survey: Survey) -> list[MapFile]:
    """Return the map files that cover the first position of a flight."""
    if not survey.track:
        return []
    first = survey.track[0]
    place = (first.longitude_deg, first.latitude_deg)
    return [one for one in survey.maps if one.covers(*place, *place)]


def _picture(
    one: MapFile, area: tuple[float, float, float, float]
) -> tuple[_Pixels, tuple[float, float, float, float]] | None:
    """Picture of an area's map tiles, with its north, west, south and east edge [deg]."""
    west, south, east, north = area
    wide = max(east - west, 1e-9) / 360.0
    wanted = math.floor(math.log2(TILES_ACROSS / wide))
    zoom = min(one.max_zoom, wanted)
    if zoom < one.min_zoom:
        return None
    first, top = (math.floor(value) for value in tile_place(north, west, zoom))
    last, bottom = (math.floor(value) for value in tile_place(south, east, zoom))
    tiles = {
        (row - top, column - first): pixels
        for row in range(top, bottom + 1)
        for column in range(first, last + 1)
        if (pixels := _pixels(one.tile(zoom, column, row))) is not None
    }
    if not tiles:
        return None
    side = next(iter(tiles.values())).shape[0]
    whole = np.ones((side * (bottom + 1 - top), side * (last + 1 - first), 3))
    for (row, column), pixels in tiles.items():
        if pixels.shape[0] == side:
            part = whole[side * row : side * (row + 1), side * column : side * (column + 1)]
            part[...] = pixels
    north_edge, west_edge = tile_corner(first, top, zoom)
    south_edge, east_edge = tile_corner(last + 1, bottom + 1, zoom)
    return _PALE + (1.0 - _PALE) * whole, (north_edge, west_edge, south_edge, east_edge)


def _pixels(content: bytes | None) -> _Pixels | None:
    """Red, green and blue of a tile's pixels, 0 to 1; None unless a square picture."""
    from matplotlib.image import imread

    if content is None:
        return None
    kind = "png" if content[:4] == b"\x89PNG" else "jpg"
    try:
        found = np.asarray(imread(io.BytesIO(content), format=kind), np.float64)
    except (OSError, ValueError, SyntaxError):
        return None
    if found.ndim == 2:
        found = np.repeat(found[:, :, None], 3, axis=2)
    if found.ndim != 3 or found.shape[0] != found.shape[1] or found.shape[0] > MOST_SIDE:
        return None
    return found[:, :, :3] / (255.0 if found.max(initial=0.0) > 1.0 else 1.0)
