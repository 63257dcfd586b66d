"""A rotation in place with a weak tag, as samples of its channel and poses."""

import math
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.analysis.whole_flights.judged_flights import (
    IntegratedTag,
    WholeFlightOptions,
    integrate_flight,
)
from uavrt.core.messages import FlightInfo, Pose, Tag
from uavrt.flight.reading.flight_reader import Flight
from uavrt.flight.samples.channel_recorder import ChannelRecorder
from uavrt.localization.antenna import PATTERNS
from uavrt.radio.opening import open_recording
from uavrt_experiments.detection.signals import (
    START_NS,
    THESIS_TAG,
    TruePulse,
    add_pulse,
    noise,
)

RATE_HZ = 3750.0
TURN_DEG_S = 6.0
WINDOW_HZ = 150.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rotation:
    """A drone that turns in place, and what it received."""

    tag: Tag
    flight: Flight
    samples: NDArray[np.complex64]
    interval_s: float
    offset_hz: float
    bearing_deg: float


def rotation(
    seed: int,
    enr_db: float | None,
    *,
    pulses: int = 160,
    like: Rotation | None = None,
    east_m: float = 0.0,
    start_ns: int = START_NS,
    then_s: float | None = None,
) -> Rotation:
    """Make a rotation.

    `enr_db`: that of a pulse on boresight; None of no tag.
    `like`: another flight of the same tag, far away to the north.
    `east_m`: where the drone turns.
    `then_s`: interval of the second half; the tag is listed with both.
    """
    rng = np.random.default_rng(seed)
    tag = replace(THESIS_TAG, interval_uncertainty_s=0.030)
    if then_s is not None:
        tag = replace(tag, pulse_intervals_s=(*tag.pulse_intervals_s, then_s))
    duration_s = pulses * tag.pulse_intervals_s[0]
    interval_s = tag.pulse_intervals_s[0] + rng.uniform(-0.02, 0.02)
    offset_hz, bearing_deg = rng.uniform(-100.0, 100.0), rng.uniform(0.0, 360.0)
    if like is not None:
        interval_s = like.interval_s + rng.uniform(-4e-5, 4e-5)
        offset_hz, bearing_deg = like.offset_hz, like.bearing_deg
    samples = noise(rng, round(duration_s * RATE_HZ))
    start_s = rng.uniform(0.0, interval_s)
    shortest_s = min(interval_s, then_s or interval_s)
    for number in range(int((duration_s - start_s) / shortest_s)):
        at_s = start_s + number * interval_s + rng.uniform(-0.01, 0.01)
        half_s = 0.5 * duration_s
        if then_s is not None and at_s > half_s:
            since = number - int((half_s - start_s) / interval_s)
            at_s = half_s + since * then_s + rng.uniform(-0.01, 0.01)
        if then_s is not None and at_s > duration_s - 0.1:
            break
        if enr_db is not None:
            gain_db = float(PATTERNS["RA-23K"].gain_db(bearing_deg - TURN_DEG_S * at_s))
            pulse = TruePulse(start_s=at_s, offset_hz=offset_hz, enr_db=enr_db + gain_db)
            phase = rng.uniform(0.0, 2.0 * math.pi)
            add_pulse(
                samples, pulse, sample_rate_hz=RATE_HZ, width_s=tag.pulse_width_s, phase=phase
            )
    poses = (_pose(step / 5.0, start_ns, east_m) for step in range(int(5.0 * duration_s)))
    return Rotation(
        tag=tag,
        flight=made.recorded_flight(flight_info(f"rotation {seed}", tag, start_ns), poses),
        samples=samples,
        interval_s=interval_s,
        offset_hz=offset_hz,
        bearing_deg=bearing_deg,
    )


def flight_info(directory: Path | str, tag: Tag, start_ns: int = START_NS) -> FlightInfo:
    """Make what starts a flight that receives a tag's channel alone."""
    return made.flight_info(
        directory,
        (tag,),
        start_time_ns=start_ns,
        center_frequency_hz=tag.frequency_hz,
        sample_rate_hz=RATE_HZ,
    )


def judged(
    flight: Flight, tag: Tag, samples: Path, start_ns: int = START_NS, **options: Any
) -> IntegratedTag:
    """Judge a whole flight by samples in a file."""
    with closing(
        open_recording(
            samples,
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=tag.frequency_hz,
            start_time_ns=start_ns,
        )
    ) as source:
        how = WholeFlightOptions(pattern=PATTERNS["RA-23K"], **options)
        return integrate_flight(flight, source, [tag], how)[0]


def judged_rotation(
    flown: Rotation, folder: Path, false_alarm_probability: float = 0.01
) -> IntegratedTag:
    """Judge a whole rotation; its samples are written into a folder."""
    samples = folder / "samples.cf32"
    flown.samples.tofile(samples)
    return judged(
        flown.flight,
        flown.tag,
        samples,
        flown.flight.info.start_time_ns,
        frequency_window_hz=WINDOW_HZ,
        false_alarm_probability=false_alarm_probability,
    )


def keep_channel(directory: Path, flown: Rotation) -> None:
    """Keep the samples of a flight as the drone does."""
    keeping = ChannelRecorder(directory, budget_mb=100.0, minimum_free_mb=0.0)
    block = made.channel_block(
        flown.samples.astype(np.complex64),
        0,
        RATE_HZ,
        start_ns=START_NS,
        center_frequency_hz=flown.tag.frequency_hz,
    )
    keeping.put([block])
    keeping.close()


def _pose(time_s: float, start_ns: int, east_m: float) -> Pose:
    return made.pose(
        start_ns + round(time_s * 1e9),
        35.0,
        -111.0 + east_m / 91_290.0,
        altitude_relative_m=50.0,
        altitude_amsl_m=2050.0,
        yaw_deg=TURN_DEG_S * time_s % 360.0,
    )


@pytest.fixture(scope="session")
def weak() -> Rotation:
    """A tag of 6 dB on boresight: groups of three need 9.7 dB while turning."""
    return rotation(3, 6.0)
