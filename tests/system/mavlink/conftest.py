"""The drone side and fixtures of `tests/unit/mavlink`."""

from tests.unit.mavlink.conftest import (  # noqa: F401  # fixtures
    make_pulse_fixture,
    thesis_tag,
    until_fixture,
    world,
)
