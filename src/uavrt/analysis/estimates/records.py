"""Convert bearings and positions to plain records for JSON output, web page and tables."""

import math
from typing import Any

from uavrt.analysis.estimates.position_words import remarks_of
from uavrt.core.clock import iso_utc
from uavrt.localization.estimates.flight_estimates import TagBearing, TagPosition

_OF_BEARING = (
    *("bearing_deg", "sigma_deg", "method", "pulses", "accepted", "ambiguous"),
    *("second_lobe_probability", "evidence", "reduced_chi2", "multipath_suspected"),
    *("level_db", "fading_db", "confidence"),
)
_OF_TURN = (
    *("latitude_deg", "longitude_deg", "altitude_amsl_m"),
    *("start_time_ns", "middle_time_ns", "end_time_ns"),
)
_OF_POSITION = (
    *("method", "latitude_deg", "longitude_deg", "radius50_m", "radius95_m"),
    *("outlier_probabilities", "at_edge", "heading_error_deg", "heading_error_sigma_deg"),
)
_OF_PLACE = ("latitude_deg", "longitude_deg", "radius50_m", "radius95_m")


def known(value: Any) -> Any:
    """Replace NaN and infinities, which JSON cannot represent, by None."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def bearing_record(one: TagBearing) -> dict[str, Any]:
    """Return a bearing's fields by name, including its cautions."""
    found = one.bearing
    return {
        "tag_id": one.tag_id,
        "interval90_deg": None if found.interval90_deg is None else [*found.interval90_deg],
        **{name: known(getattr(found, name)) for name in _OF_BEARING},
        "paths_deg": None if found.paths_deg is None else [*found.paths_deg],
        **{name: known(getattr(one, name)) for name in _OF_TURN},
        "remarks": [*found.remarks],
    }


def position_record(one: TagPosition) -> dict[str, Any]:
    """Return a position's fields by name; for a tag without a position, the reason."""
    tag = {"tag_id": one.tag_id, "name": one.name, "frequency_hz": one.frequency_hz}
    found = one.position
    if found is None:
        return {**tag, "reason": one.reason}
    ellipse = found.ellipse95
    return {
        **tag,
        **{name: known(getattr(found, name)) for name in _OF_POSITION},
        "semi_major95_m": None if ellipse is None else ellipse.semi_major_m,
        "semi_minor95_m": None if ellipse is None else ellipse.semi_minor_m,
        "orientation_deg": None if ellipse is None else ellipse.orientation_deg,
        "bearings": found.stations,
        "powers": found.pulses,
        "cautions": [{"name": each.name, "text": each.text} for each in found.cautions],
        "remarks": [*remarks_of(found)],
        "track": [
            {
                "time": iso_utc(each.time_ns),
                "time_ns": each.time_ns,
                **{name: getattr(each, name) for name in _OF_PLACE},
            }
            for each in found.track
        ],
    }
