"""The browser of `tests/flight`."""

from tests.flight.conftest import browser  # noqa: F401  # fixture
