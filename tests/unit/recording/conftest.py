"""Pulses, poses and flights for the tests of the recordings."""

from collections.abc import Callable
from pathlib import Path

import made
import pytest

from uavrt.messages import FlightInfo, Pose, Pulse, PulsePose

START_NS = 1_700_205_419_230_494_976

MakePulse = Callable[..., Pulse]
MakePose = Callable[..., Pose]
MakeInfo = Callable[..., FlightInfo]


@pytest.fixture
def make_pulse() -> MakePulse:
    """Number n of a tag: each has another time and the thesis's numbers else."""

    def make(number: int = 0, tag_id: int = 2) -> Pulse:
        start_ns = START_NS + number * 1_256_000_001 + tag_id
        return made.pulse(
            start_ns,
            tag_id=tag_id,
            frequency_hz=148_710_000.125,
            snr_db=69.6484,
            group_snr_db=69.8253,
            score=0.219541,
            group_index=number % 3 + 1,
            group_sequence=number // 3,
            noise_psd=1.25e-12,
            predicted_next_start_ns=start_ns + 1_204_000_000,
            predicted_next_end_ns=start_ns + 1_324_000_000,
        )

    return make


@pytest.fixture
def make_pose() -> MakePose:
    def make(time_ns: int = START_NS, *, extrapolated: bool = False) -> Pose:
        return made.pose(
            time_ns,
            47.397812345,
            8.545611234,
            altitude_relative_m=12.5,
            altitude_amsl_m=488.0771,
            quaternion_wxyz=(0.700764, 0.00189066, -0.00109068, 0.71339),
            extrapolated=extrapolated,
        )

    return make


@pytest.fixture
def make_pulse_pose(make_pulse: MakePulse, make_pose: MakePose) -> Callable[..., PulsePose]:
    def make(number: int = 0, tag_id: int = 2) -> PulsePose:
        pulse = make_pulse(number, tag_id)
        return PulsePose(pulse=pulse, pose=make_pose(pulse.start_time_ns + 10_000_000))

    return make


@pytest.fixture
def make_info(tmp_path: Path) -> MakeInfo:
    def make(directory: Path | None = None) -> FlightInfo:
        tags = tuple(
            made.tag(
                tag_id,
                148.71e6 + tag_id * 1000.0,
                *(1.254, 2.0)[: tag_id // 2],
                interval_uncertainty_s=0.060,
                interval_jitter_s=0.010,
                false_alarm_probability=0.005,
                name=None if tag_id == 2 else "Lüna",
            )
            for tag_id in (2, 4)
        )
        return made.flight_info(
            directory or tmp_path / "flight_log_2023-11-17_07-16-59",
            tags,
            start_time_ns=START_NS,
            clock_offset_ns=1_700_000_000_000_000_000,
        )

    return make
