"""Locate a tag by signal strength alone, in surveys with a monopole.

Without a directional antenna there are no bearings. The strengths of received pulses along the
flight, and expected pulses that were not received, give a position. The place of the strongest
signal is reported separately (`uavrt.localization.position.levels.strongest`).
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from uavrt.core.errors import UsageError
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.levels.strongest import (
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
    """Signal strength of a tag at flight heights within one range."""

    low_m: float
    """Lower limit of the height range, above the take-off point [m]."""
    high_m: float
    pulses: int
    median_db: float
    strongest: StrongestSignal
    surface: SignalSurface | None

    @property
    def name(self) -> str:
        """Height range as text, such as ``20–40 m``."""
        return f"{self.low_m:.0f}–{self.high_m:.0f} m"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagSignal:
    """Results from one tag's signal strength: map, strongest signal, height ranges."""

    tag_id: int
    track: PowerTrack
    strongest: StrongestSignal | None
    surface: SignalSurface | None
    """Map of the signal strength; None if the flight covers no area."""
    heights: tuple[HeightBand, ...]
    """Height ranges in which at least three pulses of the tag were received, lowest first."""
    section: SignalSection | None = None
    """Signal strength in a vertical section through the tag's position or, without a position,
    through the place of the strongest signal; None if flown at one height."""

    @property
    def layers(self) -> tuple[HeightBand, ...]:
        """Height ranges with a map of signal strength; empty if fewer than two have one."""
        mapped = tuple(one for one in self.heights if one.surface is not None)
        return mapped if len(mapped) > 1 else ()


def signal_of(tag_id: int, track: PowerTrack, position: Position | None = None) -> TagSignal:
    """Map a tag's signal strength, with a vertical section through `position` or, by default,
    the strongest signal.
    """
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
