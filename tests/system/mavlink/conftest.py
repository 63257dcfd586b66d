"""Fixtures of `tests/unit/mavlink`."""

from tests.unit.mavlink.conftest import (  # noqa: F401  # fixtures
    make_world,
    thesis_tag,
    world,
)
