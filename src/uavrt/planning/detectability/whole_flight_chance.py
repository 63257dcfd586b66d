"""Probability that ``uavrt integrate`` finds a tag, computed from the energies of its pulses.

If there is a tag, the weighted sum over a whole flight has nearly a normal distribution. In
noise, the tail of its distribution is that of a shifted gamma distribution, as in the search
itself (docs/explanation/whole-flight.md).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.whole_flight.tuning import SEARCH

_Floats = NDArray[np.float64]
_Singles = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeFlightModel:
    """Parameters to predict whether a whole-flight search finds a tag."""

    least_pulses: int = 12
    """Minimum number of pulses for a whole-flight search; the ordinary detector already sums
    this many."""
    patterns: float = 6.0
    """Number of distinguishable sequences of pulse energies while the antenna turns."""
    slot_pulses: float = 0.5
    """Length of a time slot in which pulse energy is measured [pulse widths]."""
    row_bins: float = 0.5
    """Distance between neighbouring frequencies searched for a tag [1 / pulse width]."""
    loss_db: float = -0.8
    """Fitted correction [dB], subtracted from the energies, for pulses that lie between time
    slots, frequencies and searched intervals.

    With it, 400 pulses of a turning antenna need an ENR of 2.3 dB, as measured (I2)."""


MODEL = WholeFlightModel()


_TRAIN_ENR_DB = np.arange(-40.0, 40.25, 0.25)
"""ENR values of a pulse for which mean and variance of a time slot are tabulated [dB]."""
_SKEWNESSES = np.linspace(0.01, 2.0, 100)
"""Skewnesses of the summed energy for which the detection threshold is tabulated."""


class WholeFlightSum:
    """Computes for each map cell the probability that a whole flight's pulses reveal a tag.

    Pass all pulses to `look`, then all of them again to `add`.
    """

    def __init__(
        self,
        tag: Tag,
        pulses: int,
        frequency_window_hz: float,
        errors_db: _Floats,
        *,
        most_drift: float = 0.0,
    ) -> None:
        self._errors_db = errors_db
        self._log_probability = _log_probability(tag, pulses, frequency_window_hz, most_drift)
        self._noise, self._mean, self._variance = _slot_moments(round(_exponentials(tag), 2))
        self._strongest: _Singles | None = None
        self._squares: _Singles | None = None
        self._cubes: _Singles | None = None
        self._shift: _Singles | None = None
        self._spread: _Singles | None = None

    def look(self, energy: _Singles) -> None:
        """First pass: record the energy of the strongest pulse at each cell."""
        if self._strongest is None:
            self._strongest = np.array(energy)
        np.maximum(self._strongest, energy, out=self._strongest)

    def add(self, energy: _Singles) -> None:
        """Second pass: add one pulse to each cell's sum, weighted relative to the cell's
        strongest pulse.
        """
        assert self._strongest is not None
        if self._squares is None:
            self._squares, self._cubes = np.zeros_like(energy), np.zeros_like(energy)
            shape = (len(self._errors_db), *energy.shape)
            self._shift, self._spread = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        assert self._shift is not None
        assert self._spread is not None
        gain = np.float32(SEARCH.design_enr) * energy / self._strongest
        weight = gain / (1.0 + gain)
        square = weight * weight
        self._squares += square
        self._cubes += square * weight
        enr_db = 10.0 * np.log10(np.maximum(energy, 1e-9))
        for number, error_db in enumerate(self._errors_db):
            at = (enr_db + (error_db - MODEL.loss_db - _TRAIN_ENR_DB[0])) * 4.0
            row = np.clip(at + 0.5, 0, len(_TRAIN_ENR_DB) - 1).astype(np.int32)
            self._shift[number] += weight * self._mean[row]
            self._spread[number] += square * self._variance[row]

    def found(self) -> _Floats:
        """Detection probability for each level error and cell, shape (errors, …)."""
        if self._squares is None or self._cubes is None:
            raise ValueError("no pulse was added")
        assert self._shift is not None
        assert self._spread is not None
        _, skewness_of_one = self._noise
        deviation = np.sqrt(self._squares)
        skewness = skewness_of_one * self._cubes / deviation**3
        shape = 4.0 / _SKEWNESSES**2
        tops = special.gammainccinv(shape, math.exp(self._log_probability))
        tops = (tops - shape) / np.sqrt(shape)
        needed = np.interp(skewness, _SKEWNESSES, tops) * deviation
        return np.asarray(special.ndtr((self._shift - needed) / np.sqrt(self._spread)))


def whole_flight_enr_db(
    tag: Tag, gain_db: _Floats, probabilities: Sequence[float]
) -> list[float]:
    """For each probability, the ENR of a flight's strongest pulse at which a whole-flight
    search finds the tag [dB].
    """
    levels_db = np.arange(-15.0, 30.25, 0.25)
    judged = WholeFlightSum(tag, len(gain_db), 500.0, levels_db)
    energies = (10.0 ** (0.1 * (gain_db - gain_db.max()))).astype(np.float32)
    for step in (judged.look, judged.add):
        for energy in energies:
            step(energy.reshape(1))
    found = np.maximum.accumulate(judged.found()[:, 0])
    return [float(np.interp(probability, found, levels_db)) for probability in probabilities]


def _log_probability(
    tag: Tag, pulses: int, frequency_window_hz: float, most_drift: float
) -> float:
    """Log probability that noise exceeds the detection threshold under one hypothesis."""
    interval_s = tag.pulse_intervals_s[0]
    slot_s = MODEL.slot_pulses * tag.pulse_width_s
    phases = interval_s / slot_s
    intervals = max(1.0, 2.0 * tag.interval_uncertainty_s * pulses / slot_s)
    rows = 2.0 * frequency_window_hz * tag.pulse_width_s / MODEL.row_bins + 1.0
    alike = 1.55 + 2.42 * tag.interval_jitter_s / tag.pulse_width_s
    rates = len(tag.pulse_intervals_s)
    count = SEARCH.hypotheses * MODEL.patterns * phases * intervals * rows * rates / alike**2
    sag_slots = most_drift * pulses * interval_s / 4.0 / slot_s
    if sag_slots >= 1.0:
        count *= 1.0 + sag_slots / SEARCH.drift_independent_slots
    return math.log(WHOLE_FLIGHT_FALSE_ALARM) - math.log(count)


def _exponentials(tag: Tag) -> float:
    """Number of unit exponential variables whose maximum has the distribution of a time slot of
    noise.
    """
    return 2.6 + 6.6 * tag.interval_jitter_s / tag.pulse_width_s


@lru_cache(maxsize=16)
def _slot_moments(many: float) -> tuple[tuple[float, float], _Singles, _Singles]:
    """Return standard deviation and skewness of a time slot of noise, and mean and variance of
    a slot with a pulse.
    """
    energy = np.concatenate((np.linspace(0.0, 40.0, 2001), np.geomspace(40.05, 40_000.0, 2000)))
    below = -np.expm1(-energy)
    strength = 10.0 ** (_TRAIN_ENR_DB / 10.0)[:, np.newaxis]
    law = below ** (many - 1.0) * special.chndtr(2.0 * energy, 2, 2.0 * strength)
    noise = below**many
    first, second, third = (
        np.trapezoid(power * energy ** (power - 1) * (1.0 - noise), energy)
        for power in (1, 2, 3)
    )
    deviation = math.sqrt(second - first**2)
    skewness = (third - 3.0 * first * second + 2.0 * first**3) / deviation**3
    mean = np.asarray(np.trapezoid(1.0 - law, energy, axis=1))
    square = np.asarray(np.trapezoid(2.0 * energy * (1.0 - law), energy, axis=1))
    return (
        (deviation, float(skewness)),
        ((mean - first) / deviation).astype(np.float32),
        (np.maximum(square - mean**2, 0.0) / deviation**2).astype(np.float32),
    )
