"""Pulses, poses and flights for the tests of recordings: number n has its own time."""

from pathlib import Path

import made

from uavrt.core.messages import FlightInfo, Pose, Pulse, PulsePose

START_NS = 1_700_205_419_230_494_976


def pulse(number: int = 0, tag_id: int = 2) -> Pulse:
    """Make pulse n of a tag, else with the thesis's numbers."""
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


def pose(time_ns: int = START_NS, *, extrapolated: bool = False) -> Pose:
    """Make a pose of the thesis's flight."""
    return made.pose(
        time_ns,
        47.397812345,
        8.545611234,
        altitude_relative_m=12.5,
        altitude_amsl_m=488.0771,
        quaternion_wxyz=(0.700764, 0.00189066, -0.00109068, 0.71339),
        extrapolated=extrapolated,
    )


def pulse_pose(number: int = 0, tag_id: int = 2) -> PulsePose:
    """Make pulse n of a tag with the pose at its centre."""
    one = pulse(number, tag_id)
    return PulsePose(pulse=one, pose=pose(one.start_time_ns + 10_000_000))


def info(directory: Path) -> FlightInfo:
    """Make a flight of two tags."""
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
        directory, tags, start_time_ns=START_NS, clock_offset_ns=1_700_000_000_000_000_000
    )
