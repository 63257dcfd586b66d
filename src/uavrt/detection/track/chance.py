"""Log-likelihood ratios for a track: a tag's pulse against a burst there by chance.

A track of bursts is one of the many that could have begun; each of its places had a burst by
chance. The product of the likelihood ratios of its places, a tag's pulse against a burst,
exceeds A with a chance of at most 1/A (Ville's inequality; J. Ville, Étude critique de la
notion de collectif, 1939), so a bound of the tracks expected in a while over the tracks allowed
keeps the false ones to those.
"""

import math
from dataclasses import dataclass

_HEARD = 0.75
"""Share of a tag's places in which its pulse is found: one in four is faded."""
_PERIOD_S = 200.0
_CONFIRMED_FALSELY = 1e-3
"""Tracks of bursts that may be confirmed in such a period."""
_FREQUENCY_HZ = 7.0
"""Scatter of a tag's pulses around its track, one of 14 dB and its drift."""
_POWER_DB = 7.0
"""Scatter of a tag's power around that of its last pulses: an antenna that turns."""
_HIDDEN_WIDTHS = 3.0
"""Widths of a pulse in which a stronger burst hides it."""
_QUIET_PER_S = 1e-4
"""Bursts at a frequency, and ten times as many in a band, where none were heard: so few that
two pulses on a lattice outweigh them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnAir:
    """Bursts that are on air around one place of a track, none of them its own [1/s]."""

    alike_per_s: float
    """At its frequency, about as strong as what was found there."""
    hiding_per_s: float
    """At its frequency, of at least half that power."""
    begin_per_s: float
    """At any frequency of the band, about as strong: each may begin a group."""


QUIET = OnAir(alike_per_s=0.0, hiding_per_s=0.0, begin_per_s=0.0)


def log_begin(per_s: float) -> float:
    """Log odds of a track with one pulse, by the rate of bursts that may begin one [1/s]."""
    return math.log(_CONFIRMED_FALSELY / (_PERIOD_S * max(per_s, 10.0 * _QUIET_PER_S)))


def log_doubt(allowed: float, decision_s: float) -> float:
    """Log odds below which more groups like a track's are by chance than are allowed."""
    return -math.log(max(1.0, allowed * _PERIOD_S / (_CONFIRMED_FALSELY * decision_s)))


def log_odds(
    on_air: OnAir,
    *,
    width_s: float,
    late_s: float,
    spread_s: float,
    beside_hz: float,
    above_db: float,
) -> float:
    """Log-likelihood ratio of what was found at a place: a tag's pulse to a burst.

    `late_s`, `spread_s`: how much later than expected, and the standard deviation that a tag's
    pulse has.
    `beside_hz`: how far from the track's frequency.
    `above_db`: how far above the power of the track's last pulses.
    """
    seen = _seen(on_air, width_s)
    likely = math.exp(
        -0.5
        * (
            (late_s / spread_s) ** 2
            + (beside_hz / _FREQUENCY_HZ) ** 2
            + (above_db / _POWER_DB) ** 2
        )
    ) / (math.sqrt(2.0 * math.pi) * spread_s)
    return math.log(1.0 - seen + seen * likely / max(on_air.alike_per_s, _QUIET_PER_S))


def log_empty(on_air: OnAir, *, width_s: float) -> float:
    """Log-likelihood ratio of a place with nothing in it, or only a burst."""
    return math.log(1.0 - _seen(on_air, width_s))


def _seen(on_air: OnAir, width_s: float) -> float:
    return _HEARD * math.exp(-_HIDDEN_WIDTHS * width_s * on_air.hiding_per_s)
