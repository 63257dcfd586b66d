"""Estimate a bearing with any of the available methods: `estimate_bearing`."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.core.errors import NotFound, UsageError
from uavrt.core.plugins import Registry
from uavrt.localization.antenna import AntennaPattern, pattern_named
from uavrt.localization.bearing import classic_bearings as classic
from uavrt.localization.bearing.pattern_ml import pattern_ml
from uavrt.localization.headings import Headings
from uavrt.localization.results import Bearing, BearingMethod
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BearingData:
    """Input data of a bearing estimator that another installed package provides."""

    yaw_deg: _Floats
    """Direction of the boresight at each pulse, clockwise from true north [deg], shape (n,)."""
    matched_power: _Floats
    """Matched-filter power at each pulse's time over noise power, noise included, shape (n,);
    NaN for a missed pulse."""
    noise_psd: _Floats
    """Noise power density at each pulse, in any unit common to all pulses, shape (n,)."""
    pattern: AntennaPattern
    threshold_db: float
    """SNR above which a missed pulse would have been detected [dB]."""
    elevation_deg: float
    heading_sigma_deg: float


BearingEstimator = Callable[[BearingData], Bearing]
ADDED_METHODS: Registry[BearingEstimator] = Registry("uavrt.bearing_methods", {})
"""Bearing estimators that installed packages provide, by the name of the method."""


def estimate_bearing(
    yaw_deg: ArrayLike | None,
    snr_db: ArrayLike | None,
    *,
    method: BearingMethod | str = "pattern_ml",
    antenna: AntennaPattern | str = "RA-23K",
    quaternion_wxyz: ArrayLike | None = None,
    matched_power: ArrayLike | None = None,
    noise_psd: ArrayLike | None = None,
    threshold_db: float = LEVELS.threshold_db,
    elevation_deg: float = 0.0,
    folds: int = 1,
    fading_db: float | None = None,
    heading_sigma_deg: float = 0.0,
) -> Bearing:
    """Estimate the bearing of a tag from pulses received while the antenna turned.

    Parameters
    ----------
    yaw_deg : (n,) array or None
        Direction of the boresight at each pulse, clockwise from true north; None when
        `quaternion_wxyz` is given.
    snr_db : (n,) array or None
        Pulse energy over noise density, noise subtracted. NaN is a missed pulse; -inf one whose
        power was exactly the noise's. None when `matched_power` is given.
    method : str
        ``"pattern_ml"`` (the default; the only one with a posterior), ``"pca"``, ``"pca_log"``,
        ``"pca_amplitude"``, ``"pearson"``, ``"ls_linear"``, ``"ls_db"``, ``"max"``, or one of
        an installed package (docs/how-to/extend.md).
    antenna : AntennaPattern or str
        The pattern or its name in `uavrt.localization.antenna.PATTERNS`.
    quaternion_wxyz : (n, 4) array, optional
        Attitude of the antenna at each pulse, antenna frame to north-east-down; roll and pitch
        then count, too.
    matched_power : (n,) array, optional
        Replaces `snr_db`: matched power over noise power, noise included (mean S + 1), as
        read at the known time of each pulse. NaN is a miss.
    noise_psd : (n,) array, optional
        Noise density at each pulse; only ratios matter. By default they are equal.
    threshold_db : float
        SNR above which a missed pulse would have been detected.
    elevation_deg : float
        Elevation of the tag seen from the drone, negative below it.
    folds : int
        Number of pulses summed in each value.
    fading_db : float, optional
        Standard deviation of the fading; None estimates it.
    heading_sigma_deg : float
        Error that all headings share; widens the posterior.

    Returns
    -------
    Bearing
        Check `accepted` and `ambiguous`: data without a clear direction give a bearing, too.

    Raises
    ------
    UsageError
        No pulse was received, the arrays differ in length, or method or antenna is unknown.
    """
    headings = _headings(yaw_deg, quaternion_wxyz)
    count = len(headings.yaw_deg)
    power = _power(snr_db, matched_power, count)
    noise = _noise(noise_psd, count)
    heard = ~np.isnan(power)
    if not heard.any():
        raise UsageError("no pulse was received", remedy="Give at least one received pulse")
    pattern = pattern_named(antenna)
    if method in _METHODS:
        return _classic(method, headings.yaw_deg, power, noise, pattern)
    if method != "pattern_ml":
        return _added(method)(
            BearingData(
                yaw_deg=headings.yaw_deg,
                matched_power=power,
                noise_psd=noise,
                pattern=pattern,
                threshold_db=threshold_db,
                elevation_deg=elevation_deg,
                heading_sigma_deg=heading_sigma_deg,
            )
        )
    order = np.concatenate([np.flatnonzero(heard), np.flatnonzero(~heard)])
    noise_db = 10.0 * np.log10(noise[order] / np.median(noise))
    axes = None if headings.axes is None else headings.axes[order]
    missed_below = 1.0 + 10.0 ** (threshold_db / 10.0)
    return pattern_ml(
        Headings(yaw_deg=headings.yaw_deg[order], axes=axes),
        power[heard],
        np.full(int(np.sum(~heard)), missed_below),
        noise_db,
        pattern=pattern,
        elevation_deg=elevation_deg,
        folds=folds,
        fading_db=fading_db,
        heading_sigma_deg=heading_sigma_deg,
    )


def _added(method: str) -> BearingEstimator:
    if method not in ADDED_METHODS:
        known = ", ".join(["pattern_ml", *_METHODS, *ADDED_METHODS])
        raise NotFound(f"there is no method {method!r}", remedy=f"Choose from {known}")
    return ADDED_METHODS[method]


def _headings(yaw_deg: ArrayLike | None, quaternion_wxyz: ArrayLike | None) -> Headings:
    if quaternion_wxyz is not None:
        return Headings.from_quaternions(quaternion_wxyz)
    if yaw_deg is None:
        raise UsageError("headings are missing", remedy="Give yaw_deg or quaternion_wxyz")
    headings = Headings.level(yaw_deg)
    if not np.all(np.isfinite(headings.yaw_deg)):
        raise UsageError(
            "a heading is not finite", remedy="Leave out the pulses without a pose"
        )
    return headings


def _power(snr_db: ArrayLike | None, matched_power: ArrayLike | None, count: int) -> _Floats:
    """Power of each pulse over the noise power, noise included, shape (n,); NaN for missed
    pulses.
    """
    if (snr_db is None) == (matched_power is None):
        raise UsageError(
            "powers are missing or given twice", remedy="Give snr_db or matched_power"
        )
    if matched_power is not None:
        power = np.atleast_1d(np.asarray(matched_power, np.float64))
    else:
        power = 1.0 + 10.0 ** (np.atleast_1d(np.asarray(snr_db, np.float64)) / 10.0)
    if power.shape != (count,):
        raise UsageError(
            f"{count} headings, but powers of shape {power.shape}",
            remedy="Give one power for each heading",
        )
    if np.any(power < 0.0) or np.any(np.isinf(power)):
        raise UsageError("a power is negative or infinite", remedy="Leave out these pulses")
    return power


def _noise(noise_psd: ArrayLike | None, count: int) -> _Floats:
    if noise_psd is None:
        return np.ones(count)
    noise = np.atleast_1d(np.asarray(noise_psd, np.float64))
    if noise.shape != (count,) or not np.all((noise > 0.0) & np.isfinite(noise)):
        raise UsageError(
            "noise densities must be positive, one for each heading",
            remedy="Leave noise_psd out when it is not known",
        )
    return noise


def _classic(
    method: str, yaw_deg: _Floats, power: _Floats, noise: _Floats, pattern: AntennaPattern
) -> Bearing:
    signal = power - 1.0
    if method.startswith("pca"):
        used = signal > 1.0  # the original drops SNR ≤ 0 dB
    else:
        used = signal > 0.0
    used &= ~np.isnan(signal)
    if not used.any():
        raise UsageError("no pulse is above the noise", remedy="Use the method pattern_ml")
    heard = _Heard(
        yaw_deg=yaw_deg[used],
        power=signal[used] * noise[used],
        noise=noise[used],
        missed_yaw_deg=yaw_deg[np.isnan(power)],
        pattern=pattern,
    )
    plain = _METHODS[method](heard)
    return Bearing(
        bearing_deg=plain.bearing_deg,
        method=method,
        pulses=int(used.sum()),
        confidence=plain.confidence,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Heard:
    yaw_deg: _Floats
    power: _Floats
    noise: _Floats
    missed_yaw_deg: _Floats
    pattern: AntennaPattern

    @property
    def level_db(self) -> _Floats:
        return np.asarray(10.0 * np.log10(self.power))


_METHODS: dict[str, Callable[[_Heard], classic.PlainBearing]] = {
    "max": lambda of: classic.strongest(of.yaw_deg, of.power),
    "pca": lambda of: classic.pca(of.yaw_deg, of.power),
    "pca_log": lambda of: classic.pca(of.yaw_deg, of.power, scale="log"),
    "pca_amplitude": lambda of: classic.pca(of.yaw_deg, of.power, scale="amplitude"),
    "pearson": lambda of: classic.pearson(of.yaw_deg, of.level_db, of.pattern),
    "ls_db": lambda of: classic.ls_db(of.yaw_deg, of.level_db, of.pattern),
    "ls_linear": lambda of: classic.ls_linear(
        of.yaw_deg, of.power, of.noise, of.missed_yaw_deg, of.pattern
    ),
}
