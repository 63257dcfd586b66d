"""Flights past a weak tag: course, antenna levels, and search settings."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies, slot_energies
from uavrt.localization.whole_flight.flight_judgement import pulse_weights
from uavrt.localization.whole_flight.tag_places import Places, distinct, places_around
from uavrt.localization.whole_flight.train_judging import Judgement, judge
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    add_pulse,
    noise,
)

RATE_HZ = 3750.0
INTERVAL_S = THESIS_TAG.pulse_intervals_s[0]
HEIGHT_M = 50.0
PLANE = TangentPlane(latitude_deg=35.0, longitude_deg=-111.0)
_STEP_S = 0.2
_OUTSIDE_M = 1500.0
_Floats = NDArray[np.float64]
Samples = NDArray[np.complex64]
Place = Callable[[np.random.Generator], tuple[float, float]]


def _steps(count: int) -> _Floats:
    return np.arange(count).astype(np.float64) * _STEP_S


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """Path and heading of a drone, and possible places of its tag."""

    name: str
    antenna: str
    exponent: float
    """True exponent of the path loss."""
    duration_s: float
    east_m: _Floats
    """Position east of the origin of `PLANE` [m], every fifth of a second."""
    north_m: _Floats
    yaw_deg: _Floats
    tag_at: Place

    @property
    def time_s(self) -> _Floats:
        """Times of the course's columns [s]."""
        return _steps(len(self.east_m))

    @property
    def poses(self) -> PoseColumns:
        """Poses of the course as the autopilot reports them."""
        latitude, longitude = PLANE.to_geodetic(self.east_m, self.north_m)
        half = np.radians(self.yaw_deg) / 2.0
        nothing = np.zeros_like(half)
        return PoseColumns(
            time_ns=START_NS + np.rint(self.time_s * NANOSECONDS_PER_SECOND).astype(np.int64),
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_m=np.full(len(half), HEIGHT_M),
            quaternion_wxyz=np.stack((np.cos(half), nothing, nothing, np.sin(half)), axis=1),
        )

    def gain_db(
        self, east_m: float, north_m: float, pattern: AntennaPattern | None = None
    ) -> _Floats:
        """Level of a pulse at each time, relative to the strongest [dB]."""
        level_db = self.level_db(east_m, north_m, pattern)
        return np.asarray(level_db - level_db.max())

    def level_db(
        self, east_m: float, north_m: float, pattern: AntennaPattern | None = None
    ) -> _Floats:
        """Level of a pulse at each time [dB]; 0 dB is boresight 1 m away."""
        pattern = pattern or PATTERNS[self.antenna]
        east, north = east_m - self.east_m, north_m - self.north_m
        distance = np.sqrt(east**2 + north**2 + HEIGHT_M**2)
        yaw = np.radians(self.yaw_deg)
        forward = (north * np.cos(yaw) + east * np.sin(yaw)) / distance
        right = (east * np.cos(yaw) - north * np.sin(yaw)) / distance
        gain = pattern.gain_towards_db(forward, right, HEIGHT_M / distance)
        return np.asarray(gain - 10.0 * self.exponent * np.log10(distance))


def _around(
    least_m: float, most_m: float
) -> Callable[[np.random.Generator], tuple[float, float]]:
    def place(rng: np.random.Generator) -> tuple[float, float]:
        turn = rng.uniform(0.0, 2.0 * math.pi)
        distance = math.sqrt(rng.uniform(least_m**2, most_m**2))
        return distance * math.sin(turn), distance * math.cos(turn)

    return place


def turning(pulses: int = 400, *, rate_deg_s: float = 6.0) -> Course:
    """Course that turns on the spot."""
    count = round(pulses * INTERVAL_S / _STEP_S) + 1
    still = np.zeros(count)
    return Course(
        name=f"turning on the spot, {pulses} pulses",
        antenna="RA-23K",
        exponent=2.0,
        duration_s=pulses * INTERVAL_S,
        east_m=still,
        north_m=still,
        yaw_deg=_steps(count) * rate_deg_s,
        tag_at=_around(1000.0, 4000.0),
    )


def stops(number: int = 12, pulses: int = 33, *, apart_m: float = 40.0) -> Course:
    """Course with turns at stops on a grid of four columns; the tag is 3 km away, so the range
    varies by 0.3 dB at most.
    """
    each = round(pulses * INTERVAL_S / _STEP_S)
    at = np.arange(number)
    east = np.repeat((at % 4 - 1.5) * apart_m, each)
    north = np.repeat((at // 4 - 0.5 * (number // 4 - 1)) * apart_m, each)
    turn = 360.0 / (pulses * INTERVAL_S)
    return Course(
        name=f"{number} stops of {pulses} pulses",
        antenna="RA-23K",
        exponent=2.0,
        duration_s=number * pulses * INTERVAL_S,
        east_m=np.append(east, east[-1]),
        north_m=np.append(north, north[-1]),
        yaw_deg=_steps(number * each + 1) * turn,
        tag_at=_around(3000.0, 3000.1),
    )


def passing(
    pulses: int = 400,
    *,
    exponent: float = 2.0,
    speed_m_s: float = 10.0,
    aside_m: float = 1000.0,
) -> Course:
    """Course straight past a tag, with an omnidirectional antenna."""
    count = round(pulses * INTERVAL_S / _STEP_S) + 1
    along = (_steps(count) - 0.5 * _STEP_S * (count - 1)) * speed_m_s

    def aside(rng: np.random.Generator) -> tuple[float, float]:
        side = 1.0 if rng.random() < 0.5 else -1.0
        return side * aside_m, float(rng.uniform(-0.1, 0.1) * along[-1])

    return Course(
        name=f"pass at {aside_m / 1000:g} km, n = {exponent:g}, {pulses} pulses",
        antenna="isotropic",
        exponent=exponent,
        duration_s=pulses * INTERVAL_S,
        east_m=np.zeros(count),
        north_m=along,
        yaw_deg=np.zeros(count),
        tag_at=aside,
    )


def lawnmower(
    *,
    exponent: float = 2.0,
    tag: Literal["outside", "midway", "inside"] = "outside",
    side_m: float = 2000.0,
    legs: int = 5,
    speed_m_s: float = 10.0,
) -> Course:
    """Course with lanes over a square, with an omnidirectional antenna.

    `tag`: 1.5 km beyond the ends of the lanes, midway between two of them, or anywhere in the
    middle of the square.
    """
    half_m, apart_m = 0.5 * side_m, side_m / (legs - 1)
    ends = [
        (half_m * (1 if (leg + end) % 2 else -1), apart_m * leg - half_m)
        for leg in range(legs)
        for end in (0, 1)
    ]
    points = np.array(ends)
    length = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    count = int(length[-1] / speed_m_s / _STEP_S)
    gone = _steps(count) * speed_m_s

    def place(rng: np.random.Generator) -> tuple[float, float]:
        if tag == "outside":
            return half_m + _OUTSIDE_M, float(rng.uniform(-0.4, 0.4) * side_m)
        along_m = float(rng.uniform(-0.4, 0.4) * side_m)
        if tag == "inside":
            return along_m, float(rng.uniform(-0.4, 0.4) * side_m)
        return along_m, apart_m * (int(rng.integers(legs - 1)) + 0.5) - half_m

    where = {
        "outside": f"{_OUTSIDE_M / 1000:g} km outside",
        "midway": f"midway between two, {0.5 * apart_m:g} m beside",
        "inside": "anywhere inside",
    }[tag]
    return Course(
        name=f"{legs} lanes over {side_m / 1000:g} km square, tag {where}, n = {exponent:g}",
        antenna="isotropic",
        exponent=exponent,
        duration_s=count * _STEP_S,
        east_m=np.interp(gone, length, points[:, 0]),
        north_m=np.interp(gone, length, points[:, 1]),
        yaw_deg=np.zeros(count),
        tag_at=place,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """True values of a flight's tag."""

    east_m: float
    north_m: float
    interval_s: float
    offset_hz: float
    first_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class World:
    """Search ranges on a course."""

    course: Course
    slack_s: float = 0.060
    window_hz: float = 500.0
    jitter_s: float = 0.010
    spread_s: float | None = None
    """Half-width of the range of true intervals [s]; by default 0.8 of the slack."""
    spread_hz: float | None = None
    second_s: float | None = None
    """Second interval of the tag [s]; it has each in one half of the flight. None: one
    interval."""

    @property
    def tag(self) -> Tag:
        """List entry of the searched tag."""
        second = () if self.second_s is None else (self.second_s,)
        return replace(
            THESIS_TAG,
            pulse_intervals_s=(*THESIS_TAG.pulse_intervals_s, *second),
            interval_uncertainty_s=self.slack_s,
            interval_jitter_s=self.jitter_s,
        )

    def truth(self, rng: np.random.Generator) -> Truth:
        """Draw the true values of a tag."""
        east, north = self.course.tag_at(rng)
        slack = 0.8 * self.slack_s if self.spread_s is None else self.spread_s
        hertz = 0.8 * self.window_hz if self.spread_hz is None else self.spread_hz
        interval_s = INTERVAL_S + rng.uniform(-slack, slack)
        return Truth(
            east_m=east,
            north_m=north,
            interval_s=interval_s,
            offset_hz=rng.uniform(-hertz, hertz),
            first_s=rng.uniform(0.0, interval_s),
        )

    def pulses(
        self,
        rng: np.random.Generator,
        truth: Truth,
        enr_db: float,
        *,
        drift: float = 0.0,
        pattern: AntennaPattern | None = None,
    ) -> list[TruePulse]:
        """Pulses of a tag whose strongest pulse has a given level.

        `drift`: relative change of the interval over the flight.
        `pattern`: true antenna pattern, if the table is wrong.
        """
        course = self.course
        gain = course.gain_db(truth.east_m, truth.north_m, pattern or PATTERNS[course.antenna])
        at_s, found = truth.first_s, []
        while at_s + THESIS_TAG.pulse_width_s + self.jitter_s < course.duration_s:
            start_s = max(at_s + rng.uniform(-self.jitter_s, self.jitter_s), 0.0)
            level = enr_db + float(np.interp(start_s, course.time_s, gain))
            found.append(TruePulse(start_s=start_s, offset_hz=truth.offset_hz, enr_db=level))
            interval_s = truth.interval_s
            if self.second_s is not None and at_s > 0.5 * course.duration_s:
                interval_s = self.second_s
            at_s += interval_s * (1.0 + drift * (at_s / course.duration_s - 0.5))
        return found

    def energies(
        self, samples: Samples, there: NDArray[np.bool_] | None = None
    ) -> SlotEnergies:
        """Energies of a channel's samples for the search."""
        tag = self.tag
        return slot_energies(
            samples,
            np.ones(len(samples), bool) if there is None else there,
            tag=tag,
            start_ns=START_NS,
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=tag.frequency_hz,
            frequency_window_hz=self.window_hz,
        )

    def judge(
        self, energies: SlotEnergies, false_alarm_probability: float, most_drift: float = 0.0
    ) -> Judgement:
        """Evaluate a flight as `uavrt integrate` does."""
        places, chosen = looked_at(self.course)
        return judge(
            energies,
            places.gain[chosen],
            places.time_s,
            self.tag,
            false_alarm_probability=false_alarm_probability,
            most_drift=most_drift,
        )


@lru_cache(maxsize=16)
def looked_at(course: Course) -> tuple[Places, NDArray[np.intp]]:
    """Possible places around a course, and those that represent all."""
    end_ns = START_NS + round(course.duration_s * NANOSECONDS_PER_SECOND)
    pattern = PATTERNS[course.antenna]
    places = places_around(course.poses, pattern, start_ns=START_NS, end_ns=end_ns)
    return places, distinct(pulse_weights(places.gain))


def add_pulses(rng: np.random.Generator, samples: Samples, pulses: list[TruePulse]) -> None:
    """Add pulses of random phase in place."""
    for pulse in pulses:
        phase = rng.uniform(0.0, 2.0 * math.pi)
        width_s = THESIS_TAG.pulse_width_s
        add_pulse(samples, pulse, sample_rate_hz=RATE_HZ, width_s=width_s, phase=phase)


def silence(rng: np.random.Generator, course: Course) -> Samples:
    """White noise with the length of a course."""
    return noise(rng, round(course.duration_s * RATE_HZ))
