"""What ``uavrt integrate`` says, in words and as JSON."""

from typing import TYPE_CHECKING, Any

from uavrt.clock import iso_utc

if TYPE_CHECKING:
    from uavrt.analysis import IntegratedTag, TagOfFlights
    from uavrt.integration import OtherTrain, PlaceBelief


def sentence(one: "IntegratedTag") -> str:
    """Say in words what the flight says of a tag."""
    from uavrt.analysis import chance_in_words

    chance = chance_in_words(one.train.false_alarm_probability)
    what = "bursts" if one.tag.coded else "pulses"
    alone = f"; {one.heard_alone} {what} were confirmed alone" if one.heard_alone else ""
    others = "".join(f"\n  {_other(other)}" for other in one.others)
    others += "".join(f"\n  {text}" for text in one.limitations)
    if one.ambiguous is not None:
        return f"tag {one.tag.tag_id}: ambiguous, {chance} without that train{alone}{others}"
    if one.place is None:
        return f"tag {one.tag.tag_id}: not found, {chance}{alone}{others}"
    place, pulses = one.place, one.pulses
    lines = [
        f"tag {one.tag.tag_id}: found over the whole flight, {chance}{alone}",
        f"{slots_in_words(one)}, {pulses.offset_hz:+.0f} Hz from its frequency, "
        f"the strongest {place.level_db:.1f} dB",
        *where(place),
    ]
    if one.train.drift:
        lines.append(
            f"its interval changed by {100.0 * one.train.drift:+.2f} % over the flight"
        )
    return "\n  ".join(lines) + others


def slots_in_words(one: "IntegratedTag") -> str:
    """Say how many slots a train has, and of how many more can be said."""
    from uavrt.analysis import slots_of

    slots = slots_of(one)
    count, kept = len(slots.at_rate), int(slots.at_rate.sum())
    what = "bursts" if one.tag.coded else "pulses"
    rate = f" at its rate {one.train.rate}" if len(one.tag.pulse_intervals_s) > 1 else ""
    part = f", used in {kept} of them" if kept < count else ""
    return (
        f"{count} slots, one every {one.pulses.interval_s:.5f} s{rate}{part}; in "
        f"{int(slots.supported.sum())} single {what} stand out of the noise"
    )


def where(place: "PlaceBelief", flown: str = "the flight") -> list[str]:
    """Say where a tag is: in one place, in one of several, or in which direction."""
    from uavrt.analysis import LEAST_PART, POSITION_M

    parts = [one for one in place.cells.parts() if one.probability >= LEAST_PART]
    if len(parts) > 1:
        told = "; ".join(
            f"at {one.latitude_deg:.5f}, {one.longitude_deg:.5f}, within "
            f"{one.radius95_m:.0f} m ({100.0 * one.probability:.0f} %)"
            for one in parts
        )
        return [f"in one of {len(parts)} places that {flown} cannot tell apart: {told}"]
    direction = (
        f"from the middle of {flown} at {place.bearing_deg:.0f}°, "
        f"± {0.5 * place.arc50_deg:.0f}° (50 %), ± {0.5 * place.arc95_deg:.0f}° (95 %)"
    )
    if place.radius95_m > POSITION_M:
        return [direction, "no position: only its direction is known"]
    return [
        direction,
        f"at {place.latitude_deg:.5f}, {place.longitude_deg:.5f}, within "
        f"{place.radius50_m:.0f} m (50 %), {place.radius95_m:.0f} m (95 %)",
    ]


def _other(other: "OtherTrain") -> str:
    """Say what else is on a tag's frequency."""
    told = f"another train on its frequency, every {other.interval_s:.4f} s"
    if other.other_code:
        return f"bursts of another code on its frequency, every {other.interval_s:.4f} s"
    if other.ratio is None:
        return told
    above, below = other.ratio
    return f"{told}: {above}/{below} of its interval, its times alone do not tell them apart"


def record(one: "IntegratedTag") -> dict[str, Any]:
    """Make JSON of what a flight says of a tag."""
    return {
        "tag_id": one.tag.tag_id,
        "found": one.found,
        "false_alarm_probability": one.train.false_alarm_probability,
        "score": one.train.score,
        "rate": one.train.rate,
        "drift": one.train.drift,
        "ambiguous": one.ambiguous is not None,
        "other_trains": [
            {
                "interval_s": other.interval_s,
                "frequency_hz": one.tag.frequency_hz + other.offset_hz,
                "ratio": None if other.ratio is None else "{}/{}".format(*other.ratio),
                **({"other_code": True} if other.other_code else {}),
            }
            for other in one.others
        ],
        "interval_s": one.pulses.interval_s,
        "frequency_hz": one.tag.frequency_hz + one.pulses.offset_hz,
        "confirmed_alone": one.heard_alone,
        **_place_record(one.place),
        "limitations": list(one.limitations),
        "integrated_pulses": _slot_records(one) if one.found else [],
    }


def _slot_records(one: "IntegratedTag") -> list[dict[str, Any]]:
    from uavrt.analysis import slots_of

    slots = slots_of(one)
    return [
        {
            "time": iso_utc(int(time_ns)),
            "time_ns": int(time_ns),
            "energy": float(energy),
            "at_rate": bool(at_rate),
            "stands_out": bool(supported),
        }
        for time_ns, energy, at_rate, supported in zip(
            one.pulse_times_ns, one.pulses.energy, slots.at_rate, slots.supported, strict=True
        )
    ]


def _place_record(place: "PlaceBelief | None") -> dict[str, Any]:
    if place is None:
        nothing = (
            *("level_db", "bearing_deg", "arc50_deg", "arc95_deg", "latitude_deg"),
            *("longitude_deg", "radius50_m", "radius95_m", "region50", "region95"),
        )
        return {**dict.fromkeys(nothing), "places": []}
    return {
        "level_db": place.level_db,
        "bearing_deg": place.bearing_deg,
        "arc50_deg": place.arc50_deg,
        "arc95_deg": place.arc95_deg,
        "latitude_deg": place.latitude_deg,
        "longitude_deg": place.longitude_deg,
        "radius50_m": place.radius50_m,
        "radius95_m": place.radius95_m,
        "places": [
            {
                "latitude_deg": part.latitude_deg,
                "longitude_deg": part.longitude_deg,
                "radius95_m": part.radius95_m,
                "probability": part.probability,
            }
            for part in place.cells.parts()
        ],
        "region50": place.cells.outlines(0.5),
        "region95": place.cells.outlines(0.95),
    }


def sentence_of_flights(one: "TagOfFlights") -> str:
    """Say in words what several flights say of a tag."""
    from uavrt.analysis import chance_in_words

    count = len(one.flights)
    chance = chance_in_words(one.false_alarm_probability, count)
    if not one.found:
        lines = [f"tag {one.tag.tag_id}: not found in {count} flights together, {chance}"]
    elif one.together:
        lines = [f"tag {one.tag.tag_id}: found over {count} flights together, {chance}"]
    else:
        lines = [f"tag {one.tag.tag_id}: found in one of {count} flights alone, {chance}"]
    if one.place is not None:
        lines += where(one.place, "the flights")
    for alone, flight, name in zip(one.alone, one.flights, one.names, strict=True):
        by_itself = f"by itself: {chance_in_words(alone)}"
        if not flight.found:
            told = "; too weak to tell its pulses" if one.found else ""
            lines.append(f"{name}: {by_itself}{told}")
            continue
        lines.append(
            f"{name}: {slots_in_words(flight)}, "
            f"{flight.pulses.offset_hz:+.0f} Hz from its frequency; {by_itself}"
        )
        if one.place is None and flight.place is not None:
            lines += [f"  {text}" for text in where(flight.place)]
    lines += [text for flight in one.flights for text in flight.limitations]
    return "\n  ".join(dict.fromkeys(lines))


def record_of_flights(one: "TagOfFlights") -> dict[str, Any]:
    """Make JSON of what several flights say of a tag."""
    return {
        "tag_id": one.tag.tag_id,
        "found": one.found,
        "together": one.together,
        "false_alarm_probability": one.false_alarm_probability,
        **_place_record(one.place),
        "flights": [
            {"flight": name, "false_alarm_probability_alone": alone, **record(flight)}
            for name, alone, flight in zip(one.names, one.alone, one.flights, strict=True)
        ],
    }
