"""Surveys with a monopole: where a tag is from its strength alone, and where it was loudest.

Without a directional antenna there are no bearings. The pulses that were heard along the
flight, and those that must have come and were not heard, give a position; the loudest place is
named for what it is (`uavrt.localization.position.strongest`).
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
    """How strong a tag was in a layer of heights, and where."""

    low_m: float
    """Above the start."""
    high_m: float
    pulses: int
    median_db: float
    best_db: float
    strongest: StrongestSignal
    surface: SignalSurface | None
    """None when this layer covers no area."""

    @property
    def name(self) -> str:
        """The heights in words."""
        return f"{self.low_m:.0f}–{self.high_m:.0f} m"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagSignal:
    """What the strength of one tag says by itself."""

    tag_id: int
    track: PowerTrack
    strongest: StrongestSignal | None
    surface: SignalSurface | None
    """Colours of the ground; None when the flight covers no area."""
    heights: tuple[HeightBand, ...]
    """The layers that were flown, lowest first, those with three pulses or more."""
    section: SignalSection | None = None
    """From the side, around the tag's position; None when it was flown at one height."""

    @property
    def layers(self) -> tuple[HeightBand, ...]:
        """Layers with a map of their own, where there are several of them to tell apart."""
        mapped = tuple(one for one in self.heights if one.surface is not None)
        return mapped if len(mapped) > 1 else ()


def signal_of(tag_id: int, track: PowerTrack, position: Position | None = None) -> TagSignal:
    """Draw what a track says of strength alone, from the side around a position if any."""
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
                    best_db=float(snr.max()),
                    strongest=strongest_signal(part),
                    surface=_surface(part),
                )
            )
    return found
