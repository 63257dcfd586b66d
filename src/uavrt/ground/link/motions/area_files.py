"""Read the area of a motion from a file, or from a circle, for the page.

The process that reads untrusted files imports this module. It must not import the link to the
drone, whose imports take that process three times as long as its own.
"""

from typing import Any

from uavrt.core.errors import FormatError
from uavrt.ground.link.page_values import listed, number_in, places_in
from uavrt.guidance.files.area_text import MOST_CORNERS, area_in, circle, keep_out_in
from uavrt.link.tunnel.own_messages.motion_messages import MAX_PLACES


def area_of_file(body: dict[str, Any]) -> dict[str, Any]:
    """Read a file's area, ``{"name": …, "text": …}``, or a circle; raises `FormatError`."""
    if "radius_m" in body:
        (center,) = places_in([body.get("center")])
        places = circle(center, number_in(body, "radius_m"))
        return {"places": listed(places), "keep_out": []}
    name, text = body.get("name"), body.get("text")
    if not isinstance(name, str) or not isinstance(text, str):
        raise FormatError(
            "an area must have the name and the text of a file, or a center and a radius_m"
        )
    places, keep_out = area_in(text, name[:80]), keep_out_in(text, name[:80])
    if len(places) > MAX_PLACES:
        raise FormatError(
            f"{name[:80]} has {len(places)} corners; at most {MAX_PLACES} are allowed",
            remedy=f"Draw an outline of {MAX_PLACES} corners or fewer",
        )
    if sum(len(one.places) for one in keep_out) > 2 * MOST_CORNERS:
        raise FormatError(
            f"{name[:80]} has excluded areas with more than {2 * MOST_CORNERS} corners",
            remedy="Simplify these areas, so that they have fewer corners",
        )
    return {
        "places": listed(places),
        "keep_out": [
            {
                "places": listed(one.places),
                "radius_m": one.radius_m,
                "outline": listed(
                    one.places if one.radius_m is None else circle(one.places[0], one.radius_m)
                ),
            }
            for one in keep_out
        ],
    }
