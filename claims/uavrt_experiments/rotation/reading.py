"""One log of a turn, read as the thesis reads its figures 5.16 and 5.17."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.errors import UsageError
from uavrt.core.messages import PulsePose
from uavrt.core.units import NANOSECONDS_PER_SECOND, wrap_degrees_180, wrap_degrees_360
from uavrt.localization.angles import widest_gap_deg
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.results import Bearing

_Floats = NDArray[np.float64]
_PEAK_DB = 1.0
_BIN_DEG = 10.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """Results from one log of one turn."""

    time_s: _Floats
    """Time of each pulse after the first [s], shape (n,)."""
    yaw_deg: _Floats
    """Heading of each pulse as logged [deg], in [0, 360), shape (n,)."""
    snr_db: _Floats
    peak_deg: float
    """Heading where the pulses are strongest, as read from the figure by eye: of arcs of 10°
    those within 1 dB of the best; each counts once, however long the cart stood there."""
    pca_deg: float
    """Bearing by the original's estimator [deg]."""
    bearing: Bearing
    """Bearing by our estimator."""
    covered_deg: float
    """Arc of headings with pulses [deg]."""

    def shift_deg(self, bearing_deg: float) -> float:
        """Angle of the strongest pulses from the tag's bearing, [-180, 180)."""
        return wrapped(self.peak_deg - bearing_deg)


def read_turn(pulse_poses: Sequence[PulsePose], *, antenna: str = "RA-23K") -> Reading:
    """Read a log of one turn; pulses without a pose are left out.

    Raises `UsageError`: no pulse has a pose and an SNR.
    """
    used = [one for one in pulse_poses if one.pose and np.isfinite(one.pulse.snr_db)]
    if not used:
        raise UsageError("no pulse has both a pose and an SNR", remedy="Give another log")
    times = np.array([one.pulse.start_time_ns for one in used], np.int64)
    yaw = np.array([yaw_deg(one.pose.quaternion_wxyz) for one in used if one.pose])
    snr = np.array([one.pulse.snr_db for one in used])
    bearing = estimate_bearing(yaw, snr, antenna=antenna)
    return Reading(
        time_s=(times - times[0]) / NANOSECONDS_PER_SECOND,
        yaw_deg=yaw,
        snr_db=snr,
        peak_deg=_peak_deg(yaw, snr),
        pca_deg=estimate_bearing(yaw, snr, method="pca").bearing_deg,
        bearing=bearing,
        covered_deg=360.0 - widest_gap_deg(yaw),
    )


def doubled(reading: Reading, first_heading_deg: float, *, antenna: str = "RA-23K") -> Bearing:
    """Correct half-way headings: twice the change since the first pulse, added to its true
    heading.

    A half-way heading is (first + true) / 2, give or take 180° where the shorter arc changes
    sides. Twice its change is the true change, whatever the first pose was.
    """
    change = 2.0 * (reading.yaw_deg - reading.yaw_deg[0])
    yaw = wrap_degrees_360(first_heading_deg + change)
    return estimate_bearing(yaw, reading.snr_db, antenna=antenna)


def wrapped(angle_deg: float) -> float:
    """Wrap an angle to [-180, 180) degrees."""
    return wrap_degrees_180(angle_deg)


def _peak_deg(yaw_deg: _Floats, snr_db: _Floats) -> float:
    arc = (yaw_deg // _BIN_DEG).astype(int)
    arcs = np.unique(arc)
    level = np.array([snr_db[arc == one].mean() for one in arcs])
    middle = np.array([_mean_deg(yaw_deg[arc == one]) for one in arcs])
    return _mean_deg(middle[level >= level.max() - _PEAK_DB])


def _mean_deg(angles_deg: _Floats) -> float:
    return wrap_degrees_360(
        float(np.angle(np.mean(np.exp(1j * np.radians(angles_deg))), deg=True))
    )
