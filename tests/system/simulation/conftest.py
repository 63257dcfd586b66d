"""The tags and scenarios of `tests/unit/simulation`."""

from tests.unit.simulation.conftest import make_scenario, plain_tag  # noqa: F401  # fixtures
