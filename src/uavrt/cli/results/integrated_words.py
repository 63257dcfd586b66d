"""Results of ``uavrt integrate`` as sentences and as JSON."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from uavrt.analysis.covered.silence import SilentMap
    from uavrt.analysis.integrated.integrated_records import SilenceRecord
    from uavrt.analysis.whole_flights.judged_flights import IntegratedTag
    from uavrt.analysis.whole_flights.several_flights import TagOfFlights
    from uavrt.localization.whole_flight.train_judging import OtherTrain
    from uavrt.localization.whole_flight.train_place import PlaceBelief


def sentence(one: "IntegratedTag", silent: "SilentMap | None" = None) -> str:
    """Sentence on one flight's result for a tag, and on areas without the tag."""
    from uavrt.analysis.whole_flights.judged_flights import chance_in_words

    chance = chance_in_words(one.train.false_alarm_probability)
    what = "bursts" if one.tag.coded else "pulses"
    alone = f"; {one.heard_alone} {what} were confirmed alone" if one.heard_alone else ""
    others = "".join(f"\n  {_other(other)}" for other in one.others)
    others += "".join(f"\n  {text}" for text in (_antenna(one), *one.remarks))
    if one.ambiguous is not None:
        return f"tag {one.tag.tag_id}: ambiguous, {chance} without that train{alone}{others}"
    if one.place is None:
        where_not = "" if silent is None else "".join(f"\n  {t}" for t in _silence(silent))
        return f"tag {one.tag.tag_id}: not found, {chance}{alone}{where_not}{others}"
    place, pulses = one.place, one.pulses
    lines = [
        f"tag {one.tag.tag_id}: found over the whole flight, {chance}{alone}",
        f"{slots_in_words(one)}, {pulses.offset_hz:+.0f} Hz from its frequency, "
        f"the strongest {place.level_db:.1f} dB",
        *_where(place),
    ]
    if one.train.drift:
        lines.append(
            f"its interval changed by {100.0 * one.train.drift:+.2f} % over the flight"
        )
    return "\n  ".join(lines) + others


def slots_in_words(one: "IntegratedTag") -> str:
    """Sentence on how many pulses of a train were expected and how many are significant."""
    from uavrt.analysis.integrated.hindsight import slots_of

    slots = slots_of(one)
    count, kept = len(slots.at_rate), int(slots.at_rate.sum())
    what = "bursts" if one.tag.coded else "pulses"
    rate = f" at its rate {one.train.rate}" if len(one.tag.pulse_intervals_s) > 1 else ""
    part = f", used in {kept} of them" if kept < count else ""
    return (
        f"{count} slots, one every {one.pulses.interval_s:.5f} s{rate}{part}; in "
        f"{int(slots.supported.sum())} single {what} stand out of the noise"
    )


def _where(place: "PlaceBelief", flown: str = "the flight") -> list[str]:
    from uavrt.analysis.integrated.hindsight import parts_of
    from uavrt.analysis.whole_flights.verdict_words import where_in_words

    return where_in_words(place, parts_of(place), flown)


def _antenna(one: "IntegratedTag") -> str:
    return f"antenna: {one.searched.antenna}"


def _other(other: "OtherTrain") -> str:
    text = f"another train on its frequency, every {other.interval_s:.4f} s"
    if other.other_code:
        return f"bursts of another code on its frequency, every {other.interval_s:.4f} s"
    if other.ratio is None:
        return text
    above, below = other.ratio
    return f"{text}: {above}/{below} of its interval, times alone cannot distinguish them"


def _silence(silent: "SilentMap") -> list[str]:
    """Sentence on areas without the tag, with the limitations of the map."""
    from uavrt.analysis.covered.silence import around_in_words

    found = silent.coverage
    return [
        f"{around_in_words(silent.around)} (another power: --tag-power)",
        f"so on {100.0 * found.share_above(0.9):.0f} % of {found.known_km2:.1f} km²",
        f"the map: noise of the drone: {silent.noise}",
        *(f"the map: {text}" for text in found.limitations),
    ]


def record(one: "IntegratedTag", silence: "SilenceRecord | None" = None) -> dict[str, Any]:
    """JSON record of one flight's result for a tag."""
    from uavrt.analysis.integrated.integrated_records import integrated_record

    return asdict(integrated_record(one, silence))


def sentence_of_flights(one: "TagOfFlights", silent: "Sequence[SilentMap | None]") -> str:
    """Sentence on the result of several flights for a tag."""
    from uavrt.analysis.whole_flights.judged_flights import chance_in_words

    count = len(one.flights)
    chance = chance_in_words(one.false_alarm_probability, count)
    if not one.found:
        lines = [f"tag {one.tag.tag_id}: not found in {count} flights together, {chance}"]
    elif one.together:
        lines = [f"tag {one.tag.tag_id}: found over {count} flights together, {chance}"]
    else:
        lines = [f"tag {one.tag.tag_id}: found in one of {count} flights alone, {chance}"]
    if one.place is not None:
        lines += _where(one.place, "the flights")
    for alone, flight, name, own in zip(one.alone, one.flights, one.names, silent, strict=True):
        by_itself = f"by itself: {chance_in_words(alone)}"
        if not flight.found:
            remark = "; single pulses are too weak to list" if one.found else ""
            lines.append(f"{name}: {by_itself}{remark}")
            lines += [] if own is None else [f"  {text}" for text in _silence(own)]
            continue
        lines.append(
            f"{name}: {slots_in_words(flight)}, "
            f"{flight.pulses.offset_hz:+.0f} Hz from its frequency; {by_itself}"
        )
        if one.place is None and flight.place is not None:
            lines += [f"  {text}" for text in _where(flight.place)]
    lines += [_antenna(flight) for flight in one.flights]
    lines += [text for flight in one.flights for text in flight.remarks]
    return "\n  ".join(dict.fromkeys(lines))


def record_of_flights(
    one: "TagOfFlights", silences: "Sequence[SilenceRecord | None]"
) -> dict[str, Any]:
    """JSON record of a tag in several flights; interval and frequency of the clearest one."""
    from uavrt.analysis.integrated.integrated_records import PlaceRecord

    each = [
        record(flight, silence) for flight, silence in zip(one.flights, silences, strict=True)
    ]
    telling = [n for n, flight in enumerate(each) if flight["found"]] or range(len(each))
    clearest = each[min(telling, key=lambda number: one.alone[number])]
    place = asdict(PlaceRecord.of(one.place))
    if one.place is None:
        place["enr_db"] = place["level_db"] = clearest["enr_db"]
    return {
        "tag_id": one.tag.tag_id,
        "found": one.found,
        "together": one.together,
        "false_alarm_probability": one.false_alarm_probability,
        "interval_s": clearest["interval_s"],
        "frequency_hz": clearest["frequency_hz"],
        "pulses": sum(flight["pulses"] for flight in each),
        **place,
        "antenna": clearest["antenna"],
        "antenna_assumed": any(flight["antenna_assumed"] for flight in each),
        "limitations": list(dict.fromkeys(t for flight in each for t in flight["limitations"])),
        "flights": [
            {"flight": name, "false_alarm_probability_alone": alone, **flight}
            for name, alone, flight in zip(one.names, one.alone, each, strict=True)
        ],
    }
