"""Surveys with a monopole: a tag's position from signal strength alone.

Without a directional antenna there are no bearings. The pulses heard along the flight, and
expected pulses that were not, give a position. The strongest place is reported separately
(`uavrt.localization.position.strongest`).
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from uavrt.errors import UsageError
from uavrt.localization.position.power_evidence import PowerTrack
from uavrt.localization.position.strongest import (
    SignalSection,
    SignalSurface,
    StrongestSignal,
    height_bands,
    in_band,
    signal_section,
    signal_surface,
    strongest_signal,
)
from uavrt.localization.results import Position


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeightBand:
    """A tag's signal strength in a range of heights."""

    low_m: float
    """Lower edge, above the start."""
    high_m: float
    pulses: int
    median_db: float
    strongest: StrongestSignal
    surface: SignalSurface | None

    @property
    def name(self) -> str:
        """Name of the height range."""
        return f"{self.low_m:.0f}–{self.high_m:.0f} m"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagSignal:
    """Results from one tag's signal strength alone."""

    tag_id: int
    track: PowerTrack
    strongest: StrongestSignal | None
    surface: SignalSurface | None
    """Signal strength over the ground; None when the flight covers no area."""
    heights: tuple[HeightBand, ...]
    """Height ranges with three pulses or more, lowest first."""
    section: SignalSection | None = None
    """Side view around the tag's position; None when flown at one height."""

    @property
    def layers(self) -> tuple[HeightBand, ...]:
        """Height ranges with a map of their own, where there are several."""
        mapped = tuple(one for one in self.heights if one.surface is not None)
        return mapped if len(mapped) > 1 else ()


def signal_of(tag_id: int, track: PowerTrack, position: Position | None = None) -> TagSignal:
    """Map signal strength along a track, and a side view around a position if any."""
    strongest = strongest_signal(track)
    place = strongest if position is None else position
    section = None
    with suppress(UsageError):
        section = signal_section(track, place.latitude_deg, place.longitude_deg)
    return TagSignal(
        tag_id=tag_id,
        track=track,
        strongest=strongest,
        surface=_surface(track),
        heights=tuple(_heights(track)),
        section=section,
    )


def _surface(track: PowerTrack) -> SignalSurface | None:
    try:
        return signal_surface(track)
    except UsageError:
        return None


def _heights(track: PowerTrack) -> list[HeightBand]:
    found = []
    for low, high in height_bands(track.height_m[~np.isnan(track.snr_db)]):
        part = in_band(track, (low, high))
        snr = part.snr_db[~np.isnan(part.snr_db)]
        if len(snr) >= 3:
            found.append(
                HeightBand(
                    low_m=low,
                    high_m=high,
                    pulses=len(snr),
                    median_db=float(np.median(snr)),
                    strongest=strongest_signal(part),
                    surface=_surface(part),
                )
            )
    return found
