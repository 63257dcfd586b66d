"""Evaluation of a real rotation: figures, bearing, and plausibility of its poses."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.survey import Survey, read_survey
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.errors import UsageError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.recognise import ORIGINAL_POSES
from uavrt.localization.estimates.flight_estimates import EstimationOptions
from uavrt.localization.results import Bearing
from uavrt_experiments.rotation.reading import Reading, doubled, read_turn, wrapped

HALF_CIRCLE_DEG = 200.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RealRotation:
    """One tag's pulses in a real rotation, and the results from them."""

    tag_id: int
    reading: Reading
    start_time_s: float
    turned_deg: float | None
    """Total turn of the vehicle by its own poses [deg]; None without them."""
    pose_error_deg: float | None
    """Rms difference of pulse headings from the vehicle's, without a constant offset [deg]."""
    half_error_deg: float | None
    """Rms difference of pulse headings from half-way headings, without a constant
    offset [deg]."""
    original: bool
    recovered: Bearing | None
    """Bearing with corrected half-way headings; None if not requested or not needed."""
    bearing_deg: float | None
    """The tag's true bearing [deg]; None if it was not given."""

    @property
    def half_way(self) -> bool:
        """True if the logged poses are half-way ones."""
        if self.original:
            return True
        if self.pose_error_deg is None or self.half_error_deg is None:
            return False
        return self.half_error_deg < 0.5 * self.pose_error_deg

    def lines(self) -> list[str]:
        """Lines of the report on this rotation."""
        reading, found = self.reading, self.reading.bearing
        lines = [
            f"tag {self.tag_id}: {len(reading.snr_db)} pulses in {reading.time_s[-1]:.0f} s, "
            f"headings over {reading.covered_deg:.0f}°, strongest at {reading.peak_deg:.0f}°",
            f"  bearing {found.bearing_deg:.0f}° (pattern_ml), {reading.pca_deg:.0f}° (PCA)"
            + _doubts(found),
        ]
        if self.pose_error_deg is not None and self.half_error_deg is not None:
            lines.append(
                f"  headings against the vehicle's own: {self.pose_error_deg:.1f}° rms if "
                f"interpolated, {self.half_error_deg:.1f}° rms if half-way"
            )
        if self.bearing_deg is not None:
            off = wrapped(reading.peak_deg - self.bearing_deg)
            ours = wrapped(found.bearing_deg - self.bearing_deg)
            lines.append(f"  strongest pulses {off:+.0f}° and bearing {ours:+.0f}° off the tag")
        lines.append(f"  {self._verdict()}")
        if self.recovered is not None:
            lines.append(
                f"  with half-way headings undone: {self.recovered.bearing_deg:.0f}°"
                + _doubts(self.recovered)
            )
        return lines

    def _verdict(self) -> str:
        found = self.reading.bearing
        if self.half_way:
            return (
                "These headings are half-way ones: what the figures show is not where the tag "
                "is. Give --start-heading, the heading at the first pulse, to undo them."
            )
        if self.reading.covered_deg < HALF_CIRCLE_DEG:
            return "The headings keep to a half circle: no full turn, or half-way poses."
        if found.multipath_suspected:
            return "The poses are sound; the powers do not fit one direction: a reflection."
        if not found.accepted:
            return "The poses are sound; there is no direction in the powers."
        return "The poses are sound, and one direction explains the powers."


def real_rotations(
    path: Path,
    *,
    bearing_deg: float | None = None,
    start_heading_deg: float | None = None,
    antenna: str = "RA-23K",
) -> list[RealRotation]:
    """Read the rotations of a flight or an old log: one for each tag and turn.

    A log in which no turn is found is treated as one turn.

    Raises `FormatError`: the file is neither a flight nor a log.
    Raises `UsageError`: no pulse has a pose.
    """
    survey = read_survey(path, EstimationOptions(antenna=antenna))
    spans = [(one.tag_id, one.start_time_ns, one.end_time_ns) for one in survey.bearings]
    whole = survey.span_ns
    if not spans and whole is not None:
        spans = [(tag_id, *whole) for tag_id in survey.tag_ids if survey.pulses_of(tag_id)]
    found = [_rotation(survey, span, bearing_deg, start_heading_deg, antenna) for span in spans]
    if not found:
        raise UsageError(f"{path} holds no pulse", remedy="Give a flight with a rotation")
    return found


def _rotation(
    survey: Survey,
    span: tuple[int, int, int],
    bearing_deg: float | None,
    start_heading_deg: float | None,
    antenna: str,
) -> RealRotation:
    tag_id, first_ns, last_ns = span
    pulses = [
        one
        for one in survey.pulses_of(tag_id)
        if first_ns <= one.pulse.start_time_ns <= last_ns
    ]
    reading = read_turn(pulses, antenna=antenna)
    original = ORIGINAL_POSES in survey.warnings
    turned, sound, half = _against_vehicle(survey, reading, first_ns)
    result = RealRotation(
        tag_id=tag_id,
        reading=reading,
        start_time_s=first_ns / NANOSECONDS_PER_SECOND,
        turned_deg=turned,
        pose_error_deg=sound,
        half_error_deg=half,
        original=original,
        recovered=None,
        bearing_deg=bearing_deg,
    )
    if start_heading_deg is None or not result.half_way:
        return result
    recovered = doubled(reading, start_heading_deg, antenna=antenna)
    return replace(result, recovered=recovered)


def _against_vehicle(
    survey: Survey, reading: Reading, first_ns: int
) -> tuple[float | None, float | None, float | None]:
    """Turn of the vehicle [deg], and rms of the pulse headings against it and against half of
    it.
    """
    if survey.kind != "flight" or len(survey.track) < 10:
        return None, None, None
    times = np.array(
        [(pose.time_ns - first_ns) / NANOSECONDS_PER_SECOND for pose in survey.track]
    )
    yaw = np.unwrap([yaw_deg(pose.quaternion_wxyz) for pose in survey.track], period=360.0)
    true = np.interp(reading.time_s, times, yaw)
    return (
        float(np.abs(np.diff(true)).sum()),
        _misfit(reading.yaw_deg - true, 360.0),
        # Half-way headings are known give or take a half turn.
        _misfit(reading.yaw_deg - true / 2.0, 180.0),
    )


def _misfit(difference_deg: NDArray[np.float64], period_deg: float) -> float:
    """Rms deviation of angles from their circular mean [deg]."""
    turns = np.exp(2j * np.pi * difference_deg / period_deg)
    rest = np.angle(turns * np.conj(turns.mean())) * period_deg / (2.0 * np.pi)
    return float(np.sqrt(np.mean(rest**2)))


def _doubts(found: Bearing) -> str:
    if not found.accepted:
        return ", no clear direction"
    if found.multipath_suspected:
        return ", a reflection is likely"
    return ", ambiguous" if found.ambiguous else ""
