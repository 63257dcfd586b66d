"""The connection process and fixtures of `tests/unit/processes`."""

from tests.unit.processes.conftest import (  # noqa: F401  # fixtures
    bay,
    make_bay,
    two_link_bay,
)
