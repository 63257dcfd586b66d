"""``uavrt localize``: estimate positions of a flight's tags."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from uavrt.cli.options.inputs import require_content
from uavrt.cli.options.kinds import Share
from uavrt.cli.options.placing_options import USUAL_PLACING, Placing
from uavrt.cli.shown.notices import warn
from uavrt.cli.shown.outputs import print_json
from uavrt.core.clock import utc_text
from uavrt.core.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.localization.estimates.flight_estimates import TagPosition
    from uavrt.localization.results import Position

_MOST_POINTS = 12
"""Maximum number of points of a path printed as text; --json prints all."""


def localize(
    *flights: Path,
    method: str = "bayes",
    place: Placing = USUAL_PLACING,
    displacement: Share = 0.0,
    observers: Path | None = None,
    tags: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Estimate where each tag is, from bearings or, with a monopole, from signal strength.

    Parameters
    ----------
    flights
        Flight directories, pulse logs in any known format, folders of them, and files of
        bearings (a bearings.csv, or noted by hand); together they give one position for each
        tag, assuming it does not move. The positions in a positions.csv or an estimate CSV of
        UCSD's tracker are shown as they are.
    method
        One of {position_methods}. bayes gives a region with its probability, and follows a tag
        that cannot have rested; track gives where a tag was at each time, even if it may have
        rested; mle, rmr and mest compute as the original system does; rmr_ahead and mest_lenth
        as they were intended.
    displacement
        Standard deviation of the error that shifts all bearings of a tag together, as a share
        of the distance; trials with tags at known places show it. Use 0.25 for bearings by
        hand, which may agree within 4° and yet miss the animal by 20°.
    observers
        File with the bearing errors of each observer, which test trials in the tables show. By
        default, an observers.json next to a table is used.
    tags
        Tag file with the tags' names (tags.toml), for logs; a flight has its own.
    as_json
        Print a list of objects; of a tag without a position it holds the `reason`.
    """
    from uavrt.analysis.estimates.positions import read_positions
    from uavrt.analysis.estimates.records import position_record
    from uavrt.config.tags.tag_files import read_tags

    if not flights:
        raise ConfigError("no flight was named", remedy="Name a flight or a log")
    require_content(flights)
    names = {} if tags is None else {tag.tag_id: tag.name for tag in read_tags(tags)}
    found = read_positions(
        *flights,
        how=replace(place.estimation_options(method), displacement=displacement),
        warn=warn,
        observers=observers,
    )
    found = [replace(one, name=names.get(one.tag_id) or one.name) for one in found]
    several = _of_several_frequencies(found)
    if as_json:
        for one in found:
            if one.position is None:
                warn(_sentence(one, several))
        print_json([position_record(one) for one in found], indent=2)
        return
    for one in found:
        print(_sentence(one, several))
    if not found:
        print(f"{', '.join(map(str, flights))}: no bearings to locate a tag")


def _of_several_frequencies(found: Sequence["TagPosition"]) -> frozenset[int]:
    known = {(one.tag_id, one.frequency_hz) for one in found}
    numbers = [tag_id for tag_id, _ in known]
    return frozenset(one for one in numbers if numbers.count(one) > 1)


def _sentence(one: "TagPosition", several: frozenset[int]) -> str:
    """Sentence on a tag's position; with its frequency if several tags share its number."""
    from uavrt.analysis.estimates.position_words import (
        basis_in_words,
        place_in_words,
        radii_in_words,
        remarks_of,
    )

    found = one.position
    tag = f"tag {one.tag_id} ({one.name})" if one.name else f"tag {one.tag_id}"
    if one.tag_id in several and one.frequency_hz is not None:
        tag += f" at {one.frequency_hz / 1e6:.4f} MHz"
    if found is None:
        return f"{tag}: no position: {one.reason}"
    text = f"{tag}: {place_in_words(found)}"
    if found.radius50_m is not None and found.radius95_m is not None:
        text += f", within {radii_in_words(found.radius50_m, found.radius95_m)}"
    origin = "from " if found.stations or found.pulses else ""
    text += f", {origin}{basis_in_words(found)}"
    if found.at_edge:
        text += "; it may be farther out"
    return "\n  ".join([text, *remarks_of(found), *_way(found)])


def _way(found: "Position") -> list[str]:
    from uavrt.analysis.estimates.position_words import place_in_words, radii_in_words

    step = max(1, -(-len(found.track) // _MOST_POINTS))
    return [
        f"{utc_text(one.time_ns)}: {place_in_words(one)}, "
        f"within {radii_in_words(one.radius50_m, one.radius95_m)}"
        for one in (*found.track[:-1:step], *found.track[-1:])
    ]
