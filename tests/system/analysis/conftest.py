"""The flights of `tests/unit/analysis`."""

from tests.unit.analysis.conftest import scenario_of, write_flight  # noqa: F401  # fixtures
