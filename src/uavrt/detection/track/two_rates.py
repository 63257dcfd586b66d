"""Decide at which of its two rates a tag is sending, by the pulses expected at each.

Every second pulse sent at one rate makes a train of twice the interval, so a pulse that a track
expects may have been sent at the other rate. A track at the other rate is started from each
pulse at which the tag may have switched. The evidence for a rate is the sum of the
log-likelihood ratios of a pulse to none, over the pulses expected at that rate.

A pulse that both rates expect waits until one rate leads by a log-likelihood of 8. After 2.5 of
the longer intervals it is reported as detected. Without waiting, about two pulses after each
switch were confirmed at the wrong rate; with it, none in 256 switches.
"""

import math
from collections.abc import Iterable

from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.tuning import RATES


def log_evidence(power: float, strength: float) -> float:
    """Log-likelihood ratio of a pulse of ENR `strength` to none, for a cell's power: log I0(2
    sqrt(strength × power)) - strength, I0 by its asymptotic form.
    """
    argument = 2.0 * math.sqrt(strength * max(power, 0.0))
    if argument < 2.0:
        return argument * argument / 4.0 - strength
    return argument - 0.5 * math.log(2.0 * math.pi * argument) - strength


def start_other_rate(track: Track) -> None:
    """Start a track at the other rate from each received pulse that has none yet."""
    since_s = max((other.settled_s for other in track.at_other_rate), default=-math.inf)
    since_s = max(since_s, track.settled_s) + track.tag.pulse_width_s
    for slot in track.received:
        if slot.time_s > since_s:
            track.at_other_rate.append(_at_other_rate(track, slot))
    del track.at_other_rate[: -RATES.most_starts]


def _at_other_rate(track: Track, start: Slot) -> Track:
    rate = 3 - track.rate
    nominal_s = track.tag.pulse_intervals_s
    other = Track(tag=track.tag, rate=rate, offset_hz=track.offset_hz, score=track.score)
    # The crystal's error is the same at both rates; the error of their ratio remains.
    scale = track.interval_s / nominal_s[track.rate - 1]
    other.continue_from(
        start, interval_s=nominal_s[rate - 1] * scale, share=RATES.uncertainty_share
    )
    return other


def lags(track: Track, other: Track) -> bool:
    """True if a track at the other rate has not been evaluated as far as this track."""
    return other.expected()[0] < track.time_s + _margin_s(track)


def decide_rate(track: Track) -> Track | None:
    """Decide between the rates if one leads clearly; return the other track if it wins."""
    upto_s = track.time_s + _margin_s(track)
    enr = strength(track)
    leads: list[tuple[float, Track]] = []
    left = []
    for other in track.at_other_rate:
        since_s = max(other.settled_s, track.slots[0].time_s) + track.tag.pulse_width_s
        lead = evidence(_between(other, since_s, upto_s), enr)
        lead -= evidence(_between(track, since_s, upto_s), enr)
        leads.append((lead, other))
        if lead < -RATES.decisive_log or other.dead:
            track.settled_s = max(track.settled_s, other.settled_s)
        else:
            left.append(other)
    track.at_other_rate = left
    most, best = max(leads, key=lambda pair: pair[0], default=(0.0, None))
    received = best is not None and best.last_accepted_s > best.settled_s
    winner = best if received and most > RATES.decisive_log else None
    if winner is not None:
        starts_s = [
            other.settled_s for lead, other in leads if lead > most - RATES.decisive_log
        ]
        _mark_disputed(track, winner, starts_s)
    # Before the first pulse at which it may have switched, the rate is the track's.
    since = [other.settled_s for other in left] if winner is None else [winner.settled_s]
    certain_s = min(since, default=track.time_s) + track.tag.pulse_width_s
    track.certain_s = max(track.certain_s, certain_s)
    return winner


def _mark_disputed(track: Track, winner: Track, starts_s: list[float]) -> None:
    """Mark the pulses with a rate that depends on the time of the switch.

    The switch is certain, but its time is not: a noise peak where only one rate expects a pulse
    can make a wrong time likelier.
    """
    first_s, last_s, since_s = min(starts_s), max(starts_s), winner.settled_s
    half_s = track.tag.pulse_width_s / 2.0
    for slot in track.slots:
        slot.disputed |= first_s + half_s < slot.time_s < since_s + half_s
    for slot in winner.slots:
        slot.disputed |= since_s + half_s < slot.time_s < last_s - half_s


def change_rate(track: Track, other: Track) -> None:
    """Continue a track at another rate, with the values of the tag's track at that rate."""
    track.rate = other.rate
    track.time_s, track.interval_s = other.time_s, other.interval_s
    track.variance, track.number = other.variance, other.number
    track.slots = other.slots
    track.offset_hz, track.steady_hz = other.offset_hz, other.steady_hz
    track.since_accepted, track.trust = other.since_accepted, other.trust
    track.last_accepted_s = other.last_accepted_s
    track.sequences = {}
    track.certain_s = track.time_s + _margin_s(track)
    track.at_other_rate = []
    track.settled_s = other.last_accepted_s - track.tag.pulse_width_s


def _between(track: Track, since_s: float, upto_s: float) -> list[Slot]:
    return [slot for slot in track.slots if since_s < slot.time_s < upto_s]


def _margin_s(track: Track) -> float:
    return 0.25 * min(track.tag.pulse_intervals_s)


def evidence(slots: Iterable[Slot], enr: float) -> float:
    """Log-likelihood ratio of pulses of ENR `enr` in all given slots to noise alone.

    The largest of V cells replaces the mean of their likelihoods, so the logarithm of V is
    subtracted.
    """
    return sum(
        log_evidence(s.measured.power, enr) - math.log(max(s.volume, 1.0)) for s in slots
    )


def strength(track: Track) -> float:
    """Mean ENR of the two strongest of the last four pulses, at least 8 and at most 30, because
    at the longer interval every second detection is noise.
    """
    recent = [slot.measured.enr for slot in track.received]
    strongest = sorted(recent[-4:])[-2:]
    level = sum(strongest) / max(1, len(strongest))
    return min(max(level, 8.0), 30.0)
