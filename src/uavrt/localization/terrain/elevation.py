"""Interpolate ground heights from the rasters of any number of files.

Rasters of one grid (tiles of one set) are joined before interpolation, so that no step occurs
at their borders. Neighbouring tiles may share a row, as in SRTM, or not.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.core.earth.geodesy import utm
from uavrt.core.errors import UsageError
from uavrt.core.units import wrap_degrees_180

ELLIPSOID = "ellipsoid"
"""Name of the height datum for heights above the WGS84 ellipsoid."""
_Floats = NDArray[np.float64]
_Window = tuple[int, int, int, int]
_MOST_POINTS = 150_000_000
_LATTICE = 12
_PLAUSIBLE_HEIGHTS_M = (-600.0, 9000.0)
"""Range of valid heights [m], from below the Dead Sea upwards; values outside mark missing
data."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Raster:
    """Heights on a regular grid, which are read from a file on demand."""

    name: str
    epsg: int
    """EPSG code of the coordinates: 4326, or UTM on WGS 84 (32601 to 32660, 32701 to 32760)."""
    x: float
    """Longitude [deg] or easting [m] of the first column's points."""
    y: float
    step_x: float
    """Step between columns [deg or m], positive to the east."""
    step_y: float
    """Step between rows [deg or m], positive to the south."""
    rows: int
    columns: int
    datum: str | None
    """Datum of the heights, such as ``EGM96`` or ``ellipsoid``; None if the file does not state
    it."""
    read: Callable[[_Window], NDArray[np.float32]]
    """Function that reads a window of rows and columns (first, end); unknown heights are
    NaN."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Elevation:
    """Ground heights from several rasters."""

    rasters: tuple[Raster, ...]
    sea: bool = False
    """True if positions outside all rasters are water at height 0."""
    _sheets: list[list[Raster]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sheets: list[list[Raster]] = []
        for one in self.rasters:
            for sheet in sheets:
                if _of_one_grid(sheet[0], one):
                    sheet.append(one)
                    break
            else:
                sheets.append([one])
        # The finest raster first, as the most accurate.
        sheets.sort(key=lambda sheet: _step_m(sheet[0]))
        object.__setattr__(self, "_sheets", sheets)

    @property
    def datums(self) -> tuple[str, ...]:
        """Datums of the rasters, each once; "unknown" for a file that states none."""
        return tuple(sorted({one.datum or "unknown" for one in self.rasters}))

    @property
    def cautions(self) -> tuple[str, ...]:
        """Warnings for the operator about the heights' datums; empty if there are none."""
        said = []
        if ELLIPSOID in self.datums:
            said.append(
                "the elevation files give heights above the ellipsoid: only differences from "
                "the take-off are used"
            )
        if len(self.datums) > 1:
            said.append(
                f"the elevation files have several height datums ({', '.join(self.datums)}): "
                "where they meet, the ground may have a step of some metres"
            )
        return tuple(said)

    def heights_m(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> _Floats:
        """Heights at positions given as arrays of any shape [m]; NaN if unknown."""
        latitude = np.asarray(latitude_deg, np.float64)
        longitude = np.asarray(longitude_deg, np.float64)
        shape = np.broadcast_shapes(latitude.shape, longitude.shape)
        lat = np.broadcast_to(latitude, shape).ravel()
        lon = np.broadcast_to(longitude, shape).ravel()
        if not lat.size:
            return np.full(shape, np.nan)
        heights = np.full(lat.shape, np.nan)
        covered = np.zeros(lat.shape, bool)
        for sheet in self._sheets:
            unknown = np.isnan(heights)
            if not unknown.any():
                break
            heights[unknown], inside = _read(sheet, lat[unknown], lon[unknown])
            covered[unknown] |= inside
        if self.sea:
            heights[np.isnan(heights) & ~covered] = 0.0
        return heights.reshape(shape)

    def covers(self, latitude_deg: float, longitude_deg: float) -> bool:
        """True if the height of a position is known."""
        return bool(np.isfinite(self.heights_m([latitude_deg], [longitude_deg]))[0])


def _step_m(one: Raster) -> float:
    return one.step_y * (111_000.0 if one.epsg == 4326 else 1.0)


def _of_one_grid(a: Raster, b: Raster) -> bool:
    def whole(apart: float, step: float) -> bool:
        return abs(apart / step - round(apart / step)) < 0.01

    same = a.epsg == b.epsg
    same &= math.isclose(a.step_x, b.step_x, rel_tol=1e-6)
    same &= math.isclose(a.step_y, b.step_y, rel_tol=1e-6)
    return same and whole(b.x - a.x, a.step_x) and whole(b.y - a.y, a.step_y)


def _read(sheet: list[Raster], lat: _Floats, lon: _Floats) -> tuple[_Floats, NDArray[np.bool_]]:
    first = sheet[0]
    x, y = _projected(first.epsg, lat, lon)
    turn = 360.0 / first.step_x if first.epsg == 4326 else 0.0
    column = (x - first.x) / first.step_x
    if turn:  # to the sheet's own side of the 180° meridian
        column -= turn * np.round((column - 0.5 * first.columns) / turn)
    row = (first.y - y) / first.step_y
    heights = np.full(lat.shape, np.nan)
    inside = np.zeros(lat.shape, bool)
    areas = [(one, *_offset(first, one, turn, float(np.mean(column)))) for one in sheet]
    for one, down, right in areas:
        r, c = row - down, column - right
        inside |= (r >= -0.5) & (r <= one.rows - 0.5) & (c >= -0.5) & (c <= one.columns - 0.5)
    if inside.any():
        window = (
            math.floor(row[inside].min()),
            math.floor(row[inside].max()) + 2,
            math.floor(column[inside].min()),
            math.floor(column[inside].max()) + 2,
        )
        heights[inside] = _between(
            _mosaic(areas, window), row[inside] - window[0], column[inside] - window[2]
        )
    return heights, inside


def _offset(first: Raster, one: Raster, turn: float, near: float) -> tuple[int, int]:
    right = (one.x - first.x) / first.step_x
    if turn:
        right += turn * round((near - right - 0.5 * one.columns) / turn)
    return round((first.y - one.y) / first.step_y), round(right)


def _mosaic(areas: Iterable[tuple[Raster, int, int]], window: _Window) -> NDArray[np.float32]:
    top, bottom, left, right = window
    count = (bottom - top) * (right - left)
    if count > _MOST_POINTS:
        raise UsageError(
            f"the area has {count:,} heights in the elevation files; at most {_MOST_POINTS:,} "
            "are allowed",
            remedy="Choose a smaller area, or coarser files",
        )
    points = np.full((bottom - top, right - left), np.nan, np.float32)
    for one, down, across in areas:
        r0, r1 = max(top, down), min(bottom, down + one.rows)
        c0, c1 = max(left, across), min(right, across + one.columns)
        if r0 >= r1 or c0 >= c1:
            continue
        part = points[r0 - top : r1 - top, c0 - left : c1 - left]
        unknown = np.isnan(part)
        if unknown.any():
            some = one.read((r0 - down, r1 - down, c0 - across, c1 - across))
            low, high = _PLAUSIBLE_HEIGHTS_M
            some = np.where((some > low) & (some < high), some, np.float32(np.nan))
            part[unknown] = some[unknown]
    return points


def _between(points: NDArray[np.float32], row: _Floats, column: _Floats) -> _Floats:
    """Interpolate bilinearly between known points; NaN where the nearest point is unknown."""
    rows, columns = points.shape
    r = np.clip(np.floor(row).astype(np.intp), 0, max(rows - 2, 0))
    c = np.clip(np.floor(column).astype(np.intp), 0, max(columns - 2, 0))
    down, right = np.clip(row - r, 0.0, 1.0), np.clip(column - c, 0.0, 1.0)
    total, weights = np.zeros(row.shape), np.zeros(row.shape)
    nearest_known = np.zeros(row.shape, bool)
    for dr in (0, 1):
        for dc in (0, 1):
            value = points[np.minimum(r + dr, rows - 1), np.minimum(c + dc, columns - 1)]
            weight = (down if dr else 1.0 - down) * (right if dc else 1.0 - right)
            known = ~np.isnan(value)
            total += np.where(known, value, 0.0) * weight
            weights += known * weight
            nearest_known |= known & ((down > 0.5) == bool(dr)) & ((right > 0.5) == bool(dc))
    known = nearest_known & (weights > 1e-9)
    return np.where(known, total / np.maximum(weights, 1e-9), np.nan)


def _projected(epsg: int, lat: _Floats, lon: _Floats) -> tuple[_Floats, _Floats]:
    if epsg == 4326:
        return lon, lat
    from scipy.interpolate import RectBivariateSpline  # 20 MB that the drone needs only here

    south, zone = epsg > 32700, epsg % 100
    middle = 6.0 * zone - 183.0
    near = middle + wrap_degrees_180(lon - middle)
    lats = np.linspace(lat.min() - 1e-4, lat.max() + 1e-4, _LATTICE)
    lons = np.linspace(near.min() - 1e-4, near.max() + 1e-4, _LATTICE)
    east = np.full((_LATTICE, _LATTICE), np.nan)
    north = np.full((_LATTICE, _LATTICE), np.nan)
    for i, phi in enumerate(lats):
        for j, lam in enumerate(lons):
            at = utm(float(phi), float(lam), zone=zone)
            if at is None:
                return np.full(lat.shape, 1e12), np.full(lat.shape, 1e12)
            east[i, j] = at.easting_m
            north[i, j] = at.northing_m - (1e7 if phi < 0.0 else 0.0) + (1e7 if south else 0.0)
    # The grid is distorted by metres over the whole area: a cubic through 144 points suffices.
    return (
        np.asarray(RectBivariateSpline(lats, lons, east, s=0).ev(lat, near)),
        np.asarray(RectBivariateSpline(lats, lons, north, s=0).ev(lat, near)),
    )
