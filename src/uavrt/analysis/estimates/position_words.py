"""Describe positions in text, for command line, report and page."""

from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.analysis.measure.pulse_shapes import Located
from uavrt.core.clock import utc_text
from uavrt.core.units import counted
from uavrt.localization.results import Position

Row = tuple[str, Sequence[str]]
"""Label and values of a row of facts; a row without values is not shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FactTable:
    """A small table of labelled values, for report and page."""

    rows: tuple[Row, ...] = ()
    details: tuple[Row, ...] = ()
    """Rows of facts that do not help decisions in the field and are shown only on request."""


def place_in_words(place: Located) -> str:
    """Format a position in decimal degrees with five decimals, a resolution of about 1 m."""
    return f"{place.latitude_deg:.5f}, {place.longitude_deg:.5f}"


def radii_in_words(radius50_m: float, radius95_m: float) -> str:
    """Format the radii of the circles that contain a tag with 50 % and 95 % probability."""
    return f"{radius50_m:.0f} m (50 %), {radius95_m:.0f} m (95 %)"


def basis_in_words(position: Position) -> str:
    """Return in words which data a position was estimated from, such as "3 bearings"."""
    if position.stations:
        return counted(position.stations, "bearing")
    if position.pulses:
        return f"the strength of {counted(position.pulses, 'pulse')}"
    return f"{position.method}, read from the file"


def remarks_of(position: Position) -> tuple[str, ...]:
    """Remarks to print with a position; for a moving tag they include the time of that
    position.

    The time is omitted where the tag's path is shown (method ``track``).
    """
    walks = any(one.name == "walk" for one in position.cautions)
    if not position.track or not walks or position.method == "track":
        return position.remarks
    time = utc_text(position.track[-1].time_ns)
    straight = (
        f"this was the tag's position at {time} if it moved in a straight line; its "
        "real path may be curved"
    )
    return (*position.remarks, straight)
