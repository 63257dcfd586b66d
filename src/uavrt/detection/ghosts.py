"""Ghosts: trains of pulses that the receiver makes of a stronger tag's.

A quadrature receiver shows each signal weakly at the mirror of its frequency about the radio's
centre, and one whose converter saturates at multiples of its distance from the centre too. A
ghost has the pulses of its original at the same instants; no other tag has for long.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic

from uavrt.config.ghost_places import Receiver
from uavrt.detection.masking import level
from uavrt.detection.refine import timing_error_s
from uavrt.detection.tracks import Slot, Track
from uavrt.detection.trains import H

STRONGER = 10.0**0.8
"""Power of the original over its ghost's, at least. An image is 25 to 40 dB down. The third
harmonic of a signal cut to a square wave is 9.5 dB below it; nothing else of it is nearer."""
LEAST_PULSES = 3
_SHARE = 0.7
"""Of the newest pulses that were heard of both."""
_SIGMAS = 2.5


@dataclass(frozen=True, slots=True)
class _Heard(Generic[H]):
    hearer: H
    track: Track
    level: float
    slots: list[Slot]
    frequency_hz: float


def mark_ghosts(hearers: Iterable[H], receiver: Receiver) -> list[tuple[H, Track]]:
    """Mark the tracks that are ghosts of others, and unmark those that are none any more.

    Parameters
    ----------
    hearers : iterable of PulseDetector
        All detectors of a receiver.
    receiver : Receiver

    Returns
    -------
    list of (Hearer, Track)
        Tracks that were not marked before.
    """
    heard = [
        _Heard(hearer, track, level(track), slots, hearer.absolute_hz(track))
        for hearer in hearers
        for track in hearer.tracks
        if len(slots := _accepted(track)) >= LEAST_PULSES
    ]
    strongest = max((one.level for one in heard), default=0.0)
    new = []
    for one in heard:
        if strongest < STRONGER * one.level and one.track.ghost_of is None:
            continue
        before = one.track.ghost_of
        one.track.ghost_of = _original(one, heard, receiver)
        if one.track.ghost_of is not None and before is None:
            new.append((one.hearer, one.track))
    return new


def _original(one: _Heard[H], heard: list[_Heard[H]], receiver: Receiver) -> int | None:
    """Number of the tag whose ghost a train is."""
    for other in heard:
        if (
            other.track.ghost_of is None
            and other.level >= STRONGER * one.level
            and receiver.makes(one.frequency_hz, other.frequency_hz)
            and _coincide(one, other)
        ):
            return other.hearer.tag.tag_id
    return None


def _coincide(one: _Heard[H], other: _Heard[H]) -> bool:
    """Whether the newest pulses of a train come with those of another."""
    first_ns, last_ns = other.slots[0].time_ns, other.slots[-1].time_ns
    width_s = one.track.tag.pulse_width_s
    both = together = 0
    for slot in one.slots:
        near_s = width_s / 16.0 + _SIGMAS * timing_error_s(width_s, slot.measured.power)
        near_ns = 1e9 * near_s
        if not first_ns - near_ns <= slot.time_ns <= last_ns + near_ns:
            continue
        both += 1
        together += any(abs(slot.time_ns - mate.time_ns) < near_ns for mate in other.slots)
    return together >= LEAST_PULSES and together >= _SHARE * both


def _accepted(track: Track) -> list[Slot]:
    if track.dead:
        return []
    return [slot for slot in track.slots if slot.state in ("accepted", "reported")]
