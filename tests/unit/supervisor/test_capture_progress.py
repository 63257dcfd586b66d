"""A capture that takes too long says what kept it: the radio, or the disk."""

import made
import pytest
from virtual_time import follow

from uavrt.core.messages import Health
from uavrt.drone.supervisor.mission.mission_progress import FlightProgress


@pytest.mark.parametrize(
    ("status", "reason", "dropped_a_second", "why"),
    [
        (
            "waiting for samples",
            "",
            0.0,
            "the radio delivers no samples. Check that it is plugged in",
        ),
        ("radio absent", "airspy_rx found no radio", 0.0, "airspy_rx found no radio"),
        (
            "receiving",
            "",
            1e5,
            "the samples could not be written in time. Record to a faster disk, or record less",
        ),
        (
            "receiving",
            "",
            0.0,
            "the radio delivers too few samples. Check its cable, or set a lower sample rate",
        ),
    ],
)
def test_a_capture_that_takes_too_long_says_why(
    status: str, reason: str, dropped_a_second: float, why: str
) -> None:
    now_s = 0.0
    follow(lambda: now_s)
    progress = FlightProgress(lambda _: None)
    progress.started(made.flight_info("flight_log_x", capture_s=8.0))
    while not progress.capture_over():
        assert now_s < 100.0
        now_s += 1.0
        progress.heard(
            Health(
                process="receiver",
                time_ns=0,
                status=status,
                ok=not reason,
                reason=reason,
                counters={"recording_samples_dropped": dropped_a_second * now_s},
            )
        )
    assert progress.ended("flight_log_x") == f"Raw capture failed: {why}"
