"""``uavrt localize``: where the tags of a flight are."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.analysis.positions import TagPosition


def localize(
    *flights: Path,
    method: str = "bayes",
    antenna: str | None = None,
    height: float | None = None,
    heading_error: float = 1.5,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Estimate where each tag is, from its bearings, or with a monopole from its strength.

    Parameters
    ----------
    flights
        Flight directories, pulse logs in any format that is known, folders of them: together
        they give one position for each tag, taken to rest. Or a bearings.csv; a positions.csv,
        and an estimate CSV of UCSD's tracker, give what is in them.
    method
        bayes (a region with its probability); or mle, rmr, mest as the original system computes
        them; or rmr_ahead, mest_lenth as they were meant.
    antenna
        Name of the antenna's pattern: RA-23K, RA-2A, H3, H, yagi-2, or one of another package;
        or a CSV file of angles and gains;
        monopole: no bearings, positions from strength along the flight. Without it RA-23K; for
        UCSD's pings, monopole.
    height
        With a monopole: height over the tags [m], for logs that do not tell it (UCSD's pings).
    heading_error
        Standard deviation of the error that all headings of a flight share [°]: compass,
        mounting, declination. 0 takes the headings for true.
    as_json
        Print a list of objects.
    """
    from uavrt.analysis.antenna_files import antenna_named
    from uavrt.analysis.positions import read_positions

    if not flights:
        raise ConfigError("no flight was named", remedy="Name a flight or a log")
    found = read_positions(
        *flights,
        method=method,  # type: ignore[arg-type]
        antenna=None if antenna is None else antenna_named(antenna),
        height_m=height,
        warn=lambda text: print(f"uavrt: {text}", file=sys.stderr),
        heading_sigma_deg=heading_error,
    )
    if as_json:
        print(json.dumps([_record(one) for one in found if one.position], indent=2))
        return
    for one in found:
        print(_sentence(one))
    if not found:
        print(f"{', '.join(map(str, flights))}: no bearings")


def _record(one: "TagPosition") -> dict[str, Any]:
    found = one.position
    assert found is not None
    ellipse = found.ellipse95
    return {
        "tag_id": one.tag_id,
        "method": found.method,
        "latitude_deg": found.latitude_deg,
        "longitude_deg": found.longitude_deg,
        "radius50_m": found.radius50_m,
        "radius95_m": found.radius95_m,
        "semi_major95_m": None if ellipse is None else ellipse.semi_major_m,
        "semi_minor95_m": None if ellipse is None else ellipse.semi_minor_m,
        "orientation_deg": None if ellipse is None else ellipse.orientation_deg,
        "bearings": found.stations,
        "powers": found.pulses,
        "outlier_probabilities": found.outlier_probabilities,
        "at_edge": found.at_edge,
        "heading_error_deg": found.heading_error_deg,
        "heading_error_sigma_deg": found.heading_error_sigma_deg,
        "cautions": [{"name": each.name, "text": each.text} for each in found.cautions],
        "widenings": [
            {
                "prior": each.prior,
                "by_m": each.by_m,
                "radius95_without_m": each.radius95_without_m,
            }
            for each in found.widenings
        ],
    }


def _sentence(one: "TagPosition") -> str:
    found = one.position
    if found is None:
        return f"tag {one.tag_id}: no position: {one.reason}"
    text = f"tag {one.tag_id}: {found.latitude_deg:.5f}, {found.longitude_deg:.5f}"
    if found.radius50_m is not None and found.radius95_m is not None:
        text += f", within {found.radius50_m:.0f} m (50 %), {found.radius95_m:.0f} m (95 %)"
    if found.stations:
        text += f", from {found.stations} bearing(s)"
    elif found.pulses:
        text += f", from the strength of {found.pulses} pulses"
    else:
        text += f", {found.method} as it stands in the file"
    if found.at_edge:
        text += "; it may be farther out"
    return "\n  ".join([text, *found.remarks])
