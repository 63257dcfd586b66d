"""Log-likelihood ratios for a track: a tag's pulses against bursts there by chance.

A track of bursts is one of many that could have begun; each of its places had a burst by
chance. The product of its places' likelihood ratios exceeds A with a chance of at most 1/A
(Ville's inequality; J. Ville, Étude critique de la notion de collectif, 1939). The bound is
therefore the number of expected tracks over the number of false ones allowed.
"""

import math
from dataclasses import dataclass

_HEARD = 0.75
"""Share of a tag's places with a detected pulse: one in four is faded."""
_PERIOD_S = 200.0
_CONFIRMED_FALSELY = 1e-3
"""Tracks of bursts that may be confirmed per decision period."""
_FREQUENCY_HZ = 7.0
"""Scatter of a tag's pulses around its track, for a pulse of 14 dB including drift."""
_POWER_DB = 7.0
"""Scatter of a tag's power around its last pulses, as the antenna turns."""
_HIDDEN_WIDTHS = 3.0
"""Distance within which a stronger burst hides a pulse [pulse widths]."""
_QUIET_PER_S = 1e-4
"""Assumed rate of bursts at a frequency where none were received, and ten times that in a band:
two pulses on a lattice outweigh it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnAir:
    """Rates of other signals' bursts around one place of a track [1/s]."""

    alike_per_s: float
    """At its frequency, with a power similar to that found there."""
    hiding_per_s: float
    """At its frequency, with at least half that power."""
    begin_per_s: float
    """At any frequency of the band with similar power: each may begin a group."""


QUIET = OnAir(alike_per_s=0.0, hiding_per_s=0.0, begin_per_s=0.0)


def log_begin(per_s: float) -> float:
    """Log odds of a track with one pulse, by the rate of bursts that may begin one [1/s]."""
    return math.log(_CONFIRMED_FALSELY / (_PERIOD_S * max(per_s, 10.0 * _QUIET_PER_S)))


def log_doubt(allowed: float, decision_s: float) -> float:
    """Log odds below which chance makes more groups like a track's than allowed."""
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
    """Log-likelihood ratio of a detection at an expected place: a tag's pulse to a burst.

    `late_s`, `spread_s`: delay from the expected time, and its standard deviation for a tag.
    `beside_hz`: distance from the track's frequency.
    `above_db`: power relative to the track's last pulses.
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
    """Log-likelihood ratio of a place without a pulse, or only with a burst."""
    return math.log(1.0 - _seen(on_air, width_s))


def _seen(on_air: OnAir, width_s: float) -> float:
    return _HEARD * math.exp(-_HIDDEN_WIDTHS * width_s * on_air.hiding_per_s)
