"""The pulses, poses and flights of `tests/unit/recording`."""

from tests.unit.recording.conftest import (  # noqa: F401  # fixtures
    make_info,
    make_pose,
    make_pulse,
    make_pulse_pose,
)
