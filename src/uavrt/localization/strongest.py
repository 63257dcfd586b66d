"""The strongest signal of a survey, which is not where the tag is.

A monopole hears nothing straight below it, so that a tag is loudest on a ring around it: the
largest ρ² / (ρ² + h²)^((n + 2) / 2) is at ρ = h √(2 / n), 36 m for 40 m above the tag and an
exponent of 2.5 (reference/localization.md §0.1, no. 4). People fly surveys and walk to the
peak; this names it for what it is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import UsageError
from uavrt.localization.power_evidence import PowerTrack
from uavrt.localization.tangent_plane import plane_around

_IN_A_ROW = 6

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class StrongestSignal:
    """Where a track was loudest. The tag is some way off."""

    latitude_deg: float
    longitude_deg: float
    snr_db: float
    """Mean of the pulses there."""
    ring_radius_m: float
    """How far a tag is from there, for a monopole and a path loss exponent of 2.5."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalSurface:
    """SNR over the ground, interpolated between the pulses; the colours of a signal map."""

    latitude_deg: float
    """Of the local plane's origin."""
    longitude_deg: float
    east_m: _Floats
    """(x,) from the origin."""
    north_m: _Floats
    """(y,)."""
    snr_db: _Floats
    """(y, x); NaN outside the track's hull."""


def strongest_signal(track: PowerTrack, *, exponent: float = 2.5) -> StrongestSignal:
    """Find the loudest place of a track, six pulses in a row averaged.

    Raises
    ------
    UsageError
        Nothing was heard.
    """
    heard = np.flatnonzero(~np.isnan(track.snr_db))
    if not len(heard):
        raise UsageError("nothing was heard", remedy="Fly nearer, or check the tag's frequency")
    mean = smoothed(track.snr_db[heard])
    top = int(np.argmax(mean))
    place = int(heard[top])
    return StrongestSignal(
        latitude_deg=float(track.latitude_deg[place]),
        longitude_deg=float(track.longitude_deg[place]),
        snr_db=float(mean[top]),
        ring_radius_m=float(abs(track.height_m[place]) * np.sqrt(2.0 / exponent)),
    )


def smoothed(snr_db: _Floats) -> _Floats:
    """(n,) mean of six pulses in a row, fewer at the ends."""
    window = np.ones(min(_IN_A_ROW, len(snr_db)))
    total = np.convolve(snr_db, window, mode="same")
    return np.asarray(total / np.convolve(np.ones(len(snr_db)), window, mode="same"))


def signal_surface(track: PowerTrack) -> SignalSurface:
    """Interpolate the smoothed SNR linearly between the places where pulses were heard.

    The grid's spacing is half of that of the pulses, between a 300th and a 60th of the track's
    extent, a metre at least (reference/localization.md §4).

    Raises
    ------
    UsageError
        The places do not span an area.
    """
    # The interpolator takes long to import, and only maps want it.
    from scipy.interpolate import LinearNDInterpolator

    heard = ~np.isnan(track.snr_db)
    if np.count_nonzero(heard) < 4:
        raise UsageError("fewer than four pulses make no map", remedy="Fly nearer to the tag")
    plane = plane_around(track.latitude_deg[heard], track.longitude_deg[heard])
    east, north = plane.to_local(track.latitude_deg[heard], track.longitude_deg[heard])
    extent = float(max(np.ptp(east), np.ptp(north)))
    apart = float(np.median(np.hypot(np.diff(east), np.diff(north)))) / 2.0
    step = max(1.0, float(np.clip(apart, extent / 300.0, extent / 60.0)))
    places = np.stack([east, north], axis=1)
    across = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)[1]
    if across / np.sqrt(len(places)) < 1.0:
        raise UsageError(
            "the pulses were heard along one line, which makes no map",
            remedy="Fly several lines",
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
