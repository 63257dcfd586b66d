"""Find the place of a survey's strongest signal, which is not the tag's position.

A monopole receives nothing from directly below, so a tag's signal is strongest on a ring around
it. For a drone at height h, ρ² / (ρ² + h²)^((n + 2) / 2) is greatest at the distance ρ = h √(2
/ n): 36 m for h = 40 m and n = 2.5. People in a survey tend to walk to the strongest signal, so
maps label it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane, plane_around
from uavrt.core.errors import UsageError
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.tuning import POWER
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class StrongestSignal:
    """Position of the strongest signal on a track, which is some distance away from the tag."""

    latitude_deg: float
    longitude_deg: float
    snr_db: float
    """Mean SNR of the pulses at this position [dB]."""
    ring_radius_m: float
    """Distance of the tag from this position [m], for a monopole and a path loss exponent of
    2.5."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalSurface:
    """SNR over the ground, interpolated between the pulses, from which a signal map is
    coloured.
    """

    latitude_deg: float
    """Latitude of the origin of the signal map's local plane [deg]."""
    longitude_deg: float
    east_m: _Floats
    """Coordinates of the signal map's grid east of the origin [m], shape (x,)."""
    north_m: _Floats
    """Coordinates of the signal map's grid north of the origin [m], shape (y,)."""
    snr_db: _Floats
    """Interpolated SNR [dB], shape (y, x); NaN outside the track's convex hull."""


def strongest_signal(
    track: PowerTrack, *, exponent: float = LEVELS.exponent
) -> StrongestSignal:
    """Find where a track's SNR, averaged over six pulses, is highest. Raises `UsageError`
    without received pulses.
    """
    heard = np.flatnonzero(~np.isnan(track.snr_db))
    if not len(heard):
        raise UsageError(
            "no pulse was received", remedy="Fly nearer, or check the tag's frequency"
        )
    mean = smoothed(track.snr_db[heard])
    top = int(np.argmax(mean))
    place = int(heard[top])
    return StrongestSignal(
        latitude_deg=float(track.latitude_deg[place]),
        longitude_deg=float(track.longitude_deg[place]),
        snr_db=float(mean[top]),
        ring_radius_m=float(abs(track.height_m[place]) * np.sqrt(2.0 / exponent)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalSection:
    """Vertical section of a survey: SNR by height and by horizontal distance from a
    position.
    """

    distance_m: _Floats
    """Edges of the cells in horizontal distance from the given position [m], shape (x + 1,)."""
    height_m: _Floats
    """Edges of the cells in height above the tag [m], shape (y + 1,)."""
    snr_db: _Floats
    """Median SNR of the pulses in each cell [dB], shape (y, x); NaN in empty cells."""


def height_bands(height_m: _Floats) -> list[tuple[float, float]]:
    """Divide heights (n,) into the ranges in which a survey was flown, lowest first.

    Ranges with fixed limits would split a level flight. So heights are divided where 5 m
    contain no pulse, and ranges above 15 m, such as a climb, are divided into equal ranges of
    at most 10 m.
    """
    ordered = np.sort(height_m)
    bands: list[tuple[float, float]] = []
    for level in np.split(ordered, np.flatnonzero(np.diff(ordered) > POWER.layer_m / 2.0) + 1):
        low, high = float(level[0]), float(level[-1])
        layers = (
            1
            if high - low <= 1.5 * POWER.layer_m
            else int(np.ceil((high - low) / POWER.layer_m))
        )
        edges = np.linspace(low, high, layers + 1)
        # Up to, not with, the upper edge, but for the highest pulse of each level.
        edges[-1] = np.nextafter(high, np.inf)
        bands += [(float(a), float(b)) for a, b in pairwise(edges)]
    return bands


def in_band(track: PowerTrack, band: tuple[float, float]) -> PowerTrack:
    """Return the pulses received at antenna heights from `band[0]` to below `band[1]` [m]."""
    low, high = band
    inside = (track.height_m >= low) & (track.height_m < high)
    return track.chosen(inside)


def signal_section(
    track: PowerTrack, latitude_deg: float, longitude_deg: float
) -> SignalSection:
    """Compute a vertical section of a survey: SNR by height and by distance from a position.

    Around the tag a monopole's field is equal in all directions. The section shows the null
    above the tag and the effect of height.
    """
    heard = ~np.isnan(track.snr_db)
    if len(height_bands(track.height_m[heard])) < 2:
        raise UsageError("a side view needs pulses at two heights", remedy="Fly at two heights")
    plane = TangentPlane(latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    east, north = plane.to_local(track.latitude_deg[heard], track.longitude_deg[heard])
    distance, height = np.hypot(east, north), track.height_m[heard]
    across = _edges(0.0, float(distance.max()), 24, 5.0)
    up = _edges(float(height.min()), float(height.max()), 12, 2.0)
    column = np.clip(np.searchsorted(across, distance, "right") - 1, 0, len(across) - 2)
    row = np.clip(np.searchsorted(up, height, "right") - 1, 0, len(up) - 2)
    snr = np.full((len(up) - 1, len(across) - 1), np.nan)
    for y, x in np.unique(np.stack([row, column]), axis=1).T:
        snr[y, x] = np.median(track.snr_db[heard][(row == y) & (column == x)])
    return SignalSection(distance_m=across, height_m=up, snr_db=snr)


def _edges(low: float, high: float, cells: int, least: float) -> _Floats:
    count = max(1, min(cells, int((high - low) / least)))
    return np.linspace(low, max(high, low + least), count + 1)


def smoothed(snr_db: _Floats) -> _Floats:
    """SNR averaged over six consecutive pulses, over fewer at the ends, shape (n,)."""
    window = np.ones(min(POWER.in_a_row, len(snr_db)))
    total = np.convolve(snr_db, window, mode="same")
    return np.asarray(total / np.convolve(np.ones(len(snr_db)), window, mode="same"))


def signal_surface(track: PowerTrack) -> SignalSurface:
    """Interpolate the smoothed SNR linearly between the positions where pulses were received.

    The grid's spacing is half of the distance between pulses, at least 1 m, and between a 300th
    and a 60th of the track's extent. Raises `UsageError` if the positions do not span an
    area.
    """
    # The interpolator takes long to import and is needed for maps only.
    from scipy.interpolate import LinearNDInterpolator

    heard = ~np.isnan(track.snr_db)
    if np.count_nonzero(heard) < 4:
        raise UsageError("a map needs four or more pulses", remedy="Fly nearer to the tag")
    plane = plane_around(track.latitude_deg[heard], track.longitude_deg[heard])
    east, north = plane.to_local(track.latitude_deg[heard], track.longitude_deg[heard])
    extent = float(max(np.ptp(east), np.ptp(north)))
    apart = float(np.median(np.hypot(np.diff(east), np.diff(north)))) / 2.0
    step = max(1.0, float(np.clip(apart, extent / 300.0, extent / 60.0)))
    places = np.stack([east, north], axis=1)
    across = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)[1]
    if across / np.sqrt(len(places)) < 1.0:
        raise UsageError(
            "the pulses were received along one line, so they give no map",
            remedy="Fly along several lines",
        )
    surface = LinearNDInterpolator(places, smoothed(track.snr_db[heard]))
    x = np.arange(east.min(), east.max() + step, step)
    y = np.arange(north.min(), north.max() + step, step)
    return SignalSurface(
        latitude_deg=plane.latitude_deg,
        longitude_deg=plane.longitude_deg,
        east_m=x,
        north_m=y,
        snr_db=np.asarray(surface(*np.meshgrid(x, y)), np.float64),
    )
