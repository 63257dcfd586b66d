"""Describe a whole-flight result in text, for command line, report, page and status text."""

from collections.abc import Sequence

from uavrt.analysis.covered.silence import around_in_words
from uavrt.analysis.estimates.position_words import FactTable, Row, place_in_words
from uavrt.analysis.whole_flights.judged_flights import POSITION_M, chance_in_words
from uavrt.flight.integrated import IntegratedPart, IntegratedVerdict
from uavrt.localization.whole_flight.train_place import PlaceBelief

ALL_ROUND_DEG = 330.0
"""Width of the arc that contains a tag's bearing above which no direction is stated [deg]."""


def verdict_facts(verdict: IntegratedVerdict) -> FactTable:
    """Return a small table that describes a whole-flight result for one tag."""
    together = verdict.flights > 1
    label = f"{verdict.flights} flights together" if together else "Whole flight"
    chance = chance_in_words(verdict.false_alarm_probability, verdict.flights)
    limits: Row = "Limits", verdict.remarks.split("; ") if verdict.remarks else ()
    if not verdict.found:
        silent = () if verdict.silent is None else (around_in_words(verdict.silent),)
        return FactTable(
            rows=((label, ("not found", *silent)), limits),
            details=(("False alarms", (chance,)),),
        )
    where = [f"in one of {verdict.places} places (`uavrt integrate` lists them)"]
    if verdict.places == 1 or verdict.parts:
        flown = "the flights" if together else "the flight"
        where = where_in_words(verdict, verdict.parts, flown)
    coded = verdict.searched is not None and bool(verdict.searched.gaps_s)
    heard = f"{verdict.pulses} found after the flight, {verdict.heard_live} detected in flight"
    return FactTable(
        rows=(
            (label, ("found",)),
            ("Bursts" if coded else "Pulses", (heard,)),
            ("Place", where),
            limits,
        ),
        details=(
            ("False alarms", (chance,)),
            ("Interval", (f"{verdict.interval_s:.4f} s",)),
        ),
    )


def where_in_words(
    place: PlaceBelief | IntegratedVerdict,
    parts: Sequence[IntegratedPart],
    flown: str = "the flight",
) -> list[str]:
    """Sentences on a tag's position: one, several possible ones, or a direction."""
    if len(parts) > 1:
        return [
            f"in one of {len(parts)} places that all fit {flown}:",
            *(
                f"at {place_in_words(one)}, within "
                f"{one.radius95_m:.0f} m ({100.0 * one.probability:.0f} %)"
                for one in parts
            ),
        ]
    known = place.radius95_m is not None and place.radius95_m <= POSITION_M
    lines = []
    if place.bearing_deg is not None and place.arc50_deg is not None and place.arc95_deg:
        if place.arc95_deg > ALL_ROUND_DEG and not known:
            return [f"the tag's position and direction remain unknown after {flown}"]
        lines.append(
            f"direction from the middle of {flown}: {place.bearing_deg:.0f}°, "
            f"± {0.5 * place.arc50_deg:.0f}° (50 %), ± {0.5 * place.arc95_deg:.0f}° (95 %)"
        )
    if not known:
        return [*lines, "no position: only the tag's direction is known"]
    return [
        *lines,
        f"at {place.latitude_deg:.5f}, {place.longitude_deg:.5f}, within "
        f"{place.radius50_m:.0f} m (50 %), {place.radius95_m:.0f} m (95 %)",
    ]
