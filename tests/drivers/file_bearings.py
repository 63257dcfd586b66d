"""Bearings of flights and pulse logs, read from their files."""

import os
from collections.abc import Callable

from uavrt.analysis.estimates.bearings import bearings_together, read_recorded
from uavrt.localization.estimates.flight_estimates import EstimationOptions, TagBearing


def read_bearings(
    *paths: str | os.PathLike[str],
    how: EstimationOptions | None = None,
    warn: Callable[[str], None] = lambda text: None,
) -> list[TagBearing]:
    """Estimate the bearings of flights or pulse logs, as `uavrt bearing` does."""
    return bearings_together(
        [read_recorded(path) for path in paths], how or EstimationOptions(), warn
    )
