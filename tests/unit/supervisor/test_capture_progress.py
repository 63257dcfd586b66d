"""A capture that takes too long says what kept it: the radio, or the disk."""

from collections.abc import Callable

import made
import pytest
from virtual_time import follow

from uavrt.messages import Health
from uavrt.supervisor.mission.progress import FlightProgress

CAPTURE_S = 8.0
CASES = {
    "radio gives nothing": (
        lambda _: ("waiting for samples", "", 0.0),
        "the radio gives no samples. Check that it is plugged in",
    ),
    "radio says why": (
        lambda _: ("radio absent", "airspy_rx found no radio", 0.0),
        "airspy_rx found no radio",
    ),
    "disk is slow": (
        lambda now_s: ("receiving", "", 1e5 * now_s),
        "the samples could not be written in time. Record to a faster disk, or less",
    ),
    "samples are slow": (
        lambda _: ("receiving", "", 0.0),
        "the radio gives too few samples. Check its cable, or set a lower sample rate",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_capture_that_takes_too_long_says_why(case: str) -> None:
    says: Callable[[float], tuple[str, str, float]]
    says, why = CASES[case]
    now_s = 0.0
    follow(lambda: now_s)
    progress = FlightProgress(lambda _: None)
    progress.started(made.flight_info("flight_log_x", capture_s=CAPTURE_S))
    while not progress.capture_over():
        now_s += 1.0
        status, reason, dropped = says(now_s)
        counters = {"recording_samples_dropped": dropped}
        progress.heard(
            Health(
                process="receiver",
                time_ns=0,
                status=status,
                ok=not reason,
                reason=reason,
                counters=counters,
            )
        )
        assert now_s < 100.0
    assert progress.ended("flight_log_x") == f"Raw capture failed: {why}"
