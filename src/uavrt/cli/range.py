"""``uavrt range``: how far a tag is heard, before a flight."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.cli.kinds import (
    Counts,
    Decibels,
    Metres,
    NoiseFigure,
    Power,
    PulseWidth,
    TagFrequency,
)

if TYPE_CHECKING:
    from uavrt.messages import Tag
    from uavrt.planning import LinkBudget

PROBABILITIES = (0.5, 0.9)
WHOLE_FLIGHT_DB = (3.2, 4.2)
"""ENR of the strongest of 400 pulses for Pd .5 and .9 when a whole flight is judged at once
(`uavrt integrate`): the bar of `uavrt experiment integrate` where the antenna turns."""


def range(
    *,
    tag_power: Power,
    height: Metres = 60.0,
    tag_height: Metres = 0.5,
    tags: Path | None = None,
    pulses: Counts = (3, 10, 20, 40),
    frequency: TagFrequency = 150e6,
    pulse_width: PulseWidth = 0.020,
    antenna_gain: Decibels = 4.0,
    mismatch: Decibels = 3.0,
    noise_figure: NoiseFigure = 8.0,
    flight: Path | None = None,
    whole_flight: Annotated[bool, Parameter(negative="")] = False,
    free_space: Annotated[bool, Parameter(negative="")] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Show how far a tag is heard: distance for Pd .5 and .9, and the budget line by line.

    The ENR that a group of K pulses needs is that of our detector, for the tag's interval,
    its uncertainty, jitter and false-alarm probability. The distances are for open ground: with
    hills, with trees, or with an animal that lies on its tag they are shorter.

    Parameters
    ----------
    tag_power
        Power that the tag radiates [dBm], antenna and animal included; collars: -30 to -10.
    height
        Height of the drone above the ground [m].
    tag_height
        Height of the tag above the ground [m].
    tags
        A tag file: each tag with its own frequency, pulse width, interval and K. Without it
        a tag of 1.254 s, known to 60 ms, at a false-alarm probability of 1 %.
    pulses
        Pulses in a group (K), without --tags.
    frequency
        The tag's frequency [Hz], without --tags.
    pulse_width
        The tag's pulse width [s], without --tags.
    antenna_gain
        Gain towards the tag [dBi]; 4 is usual for two elements, 2 for a monopole.
    mismatch
        Loss by polarization, cables and pointing [dB].
    noise_figure
        Noise that receiver, drone and sky add to the thermal noise [dB].
    flight
        A past flight: what the drone's noise rose to in the air is added to the noise.
    whole_flight
        Add a row for each tag of a flight that is judged at once, by uavrt integrate.
    free_space
        Ignore the ray reflected by the ground.
    as_json
        Print a list of objects.
    """
    from uavrt.planning import LinkBudget

    budget = LinkBudget(
        frequency_hz=frequency,
        pulse_width_s=pulse_width,
        tag_eirp_dbm=tag_power,
        tag_height_m=tag_height,
        drone_height_m=height,
        antenna_gain_dbi=antenna_gain,
        mismatch_db=mismatch,
        noise_figure_db=noise_figure,
        ground="free" if free_space else "two-ray",
        drone_noise_db=0.0 if flight is None else _drone_noise_db(flight),
    )
    listed = _tags(tags, pulses, frequency, pulse_width)
    own = [
        replace(budget, frequency_hz=tag.frequency_hz, pulse_width_s=tag.pulse_width_s)
        for tag in listed
    ]
    rows = [_row(tag, its) for tag, its in zip(listed, own, strict=True)]
    if whole_flight:
        each = {tag.tag_id: its for tag, its in zip(listed, own, strict=True)}
        rows += [
            {"tag_id": tag_id, "k": None, **_reach(WHOLE_FLIGHT_DB, its)}
            for tag_id, its in each.items()
        ]
    if as_json:
        print(json.dumps(rows, allow_nan=False))
    else:
        _print(rows, budget)


def _tags(
    path: Path | None, pulses: tuple[int, ...], frequency_hz: float, pulse_width_s: float
) -> "list[Tag]":
    from uavrt.config import read_tags
    from uavrt.messages import Tag

    if path is not None:
        return list(read_tags(path))
    return [
        Tag(
            tag_id=2,
            frequency_hz=frequency_hz,
            pulse_width_s=pulse_width_s,
            pulse_intervals_s=(1.254,),
            interval_uncertainty_s=0.060,
            interval_jitter_s=0.010,
            k=k,
            false_alarm_probability=0.01,
        )
        for k in pulses
    ]


def _row(tag: "Tag", budget: "LinkBudget") -> dict[str, Any]:
    from uavrt.detection import enr_needed_db

    half, most = (enr_needed_db(tag, probability) for probability in PROBABILITIES)
    return {"tag_id": tag.tag_id, "k": tag.k, **_reach((half, most), budget)}


def _drone_noise_db(flight: Path) -> float:
    from uavrt.analysis import flight_noise_of

    return round(flight_noise_of(flight).median_db, 2)


def _reach(needed: tuple[float, float], budget: "LinkBudget") -> dict[str, Any]:
    """How far, for the ENR that Pd .5 and .9 need."""
    distances = [budget.distance_m(enr) for enr in needed]
    return {
        "enr50_db": round(needed[0], 2),
        "enr90_db": round(needed[1], 2),
        "distance50_m": distances[0],
        "distance90_m": distances[1],
        "budget": [
            {"term": term, "value": round(value, 2), "unit": unit}
            for term, value, unit in budget.lines(needed[1], distances[1] or 1.0)
        ],
    }


def _print(rows: list[dict[str, Any]], budget: "LinkBudget") -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table(title=f"Heard from {budget.drone_height_m:g} m above the ground")
    for title in ("tag", "K", "ENR for Pd .5", "for Pd .9", "heard to, Pd .5", "Pd .9"):
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            str(row["tag_id"]),
            "whole flight" if row["k"] is None else str(row["k"]),
            f"{row['enr50_db']:.1f} dB",
            f"{row['enr90_db']:.1f} dB",
            _far(row["distance50_m"]),
            _far(row["distance90_m"]),
        )
    console.print(table)
    first = rows[0]
    lines = Table(title=f"Budget of tag {first['tag_id']}, K = {first['k']}, for Pd .9")
    lines.add_column("term")
    lines.add_column("value", justify="right")
    for one in first["budget"]:
        lines.add_row(one["term"], f"{one['value']:.1f} {one['unit']}")
    console.print(lines)


def _far(distance_m: float | None) -> str:
    if distance_m is None:
        return "nowhere"
    return "over 100 km" if distance_m >= 100_000.0 else f"{distance_m / 1000.0:.2f} km"
