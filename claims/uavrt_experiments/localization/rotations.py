"""Simulated rotations, and the error bound of any estimator."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.units import wrap_degrees_360
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.results import Bearing, BearingMethod

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationCase:
    """Signal and antenna of a simulated turn."""

    antenna: str = "RA-23K"
    pulses: int = 60
    snr_db: float = 20.0
    """SNR on boresight [dB]."""
    fading_db: float = 2.0
    threshold_db: float | None = None
    """SNR below which pulses are missed [dB]; None: the power is measured at every pulse's
    known time."""

    def __str__(self) -> str:
        text = f"{self.antenna}, {self.pulses} pulses, {self.snr_db:g} dB"
        text += f", fading {self.fading_db:g}"
        return (
            text if self.threshold_db is None else f"{text}, threshold {self.threshold_db:g} dB"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Estimated bearing of a turn, and its error."""

    error_deg: float
    bearing: Bearing

    @property
    def covered(self) -> bool:
        """True if the 90 % interval contains the truth; False for a method without
        an interval.
        """
        if self.bearing.interval90_deg is None:
            return False
        low, high = self.bearing.interval90_deg
        truth = self.bearing.bearing_deg - self.error_deg
        return wrap_degrees_360(truth - low) <= wrap_degrees_360(high - low)


def matched_power(rng: Generator, level_db: _Floats) -> _Floats:
    """Matched-filter power over noise power of pulses with these SNR: |√S + noise|²."""
    noise = rng.normal(0.0, np.sqrt(0.5), (2, len(level_db)))
    return np.asarray((10.0 ** (level_db / 20.0) + noise[0]) ** 2 + noise[1] ** 2)


def trial(
    rng: Generator,
    case: RotationCase,
    method: BearingMethod = "pattern_ml",
    *,
    pattern: AntennaPattern | None = None,
    believed: AntennaPattern | None = None,
    yaw_jitter_deg: float = 0.0,
    yaw_lag_deg: float = 0.0,
) -> Trial:
    """Simulate one turn past a tag at a random bearing, and estimate it.

    `rng`: random generator.
    `case`: signal and antenna.
    `method`: estimator.
    `pattern`, `believed`: the true antenna, and the one that the estimator assumes; both the
    case's by default.
    `yaw_jitter_deg`, `yaw_lag_deg`: errors of the headings: independent for each pulse, and
    common to all.
    """
    nominal = PATTERNS[case.antenna]
    truth = float(rng.uniform(0.0, 360.0))
    yaw = rng.uniform(0.0, 360.0) + np.arange(case.pulses) * 360.0 / case.pulses
    gain = (pattern or nominal).gain_db(truth - yaw)
    power = matched_power(
        rng, case.snr_db + gain + rng.normal(0.0, case.fading_db, case.pulses)
    )
    if case.threshold_db is not None:
        missed = power < 1.0 + 10.0 ** (case.threshold_db / 10.0)
        if missed.all():
            missed[int(np.argmax(power))] = False
        power[missed] = np.nan
    found = estimate_bearing(
        yaw + rng.normal(0.0, yaw_jitter_deg, case.pulses) - yaw_lag_deg,
        None,
        method=method,
        antenna=believed or nominal,
        matched_power=power,
        threshold_db=10.0 if case.threshold_db is None else case.threshold_db,
    )
    return Trial(error_deg=difference_deg(found.bearing_deg, truth), bearing=found)


def bound_deg(case: RotationCase) -> float:
    """Cramér–Rao bound [deg] with unknown level, rms over the phase of the headings.

    For a pulse of expected power M in noise of power 1, the variance is V = 1 + 2 M + (0.2303
    fading M)².
    """
    pattern = PATTERNS[case.antenna]
    variances = []
    for phase in np.linspace(0.0, 360.0 / case.pulses, 12, endpoint=False):
        off = phase + np.arange(case.pulses) * 360.0 / case.pulses
        slope = (pattern.gain_db(off + 0.5) - pattern.gain_db(off - 0.5)) * 0.2303
        m = 10.0 ** ((case.snr_db + pattern.gain_db(off)) / 10.0)
        weight = m**2 / (1.0 + 2.0 * m + (0.2303 * case.fading_db * m) ** 2)
        mean = float(weight @ slope / weight.sum())
        variances.append(1.0 / float(weight @ (slope - mean) ** 2))
    return float(np.sqrt(np.mean(variances)))
