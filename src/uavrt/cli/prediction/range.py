"""``uavrt range``: predict the detection range of a tag before a flight."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.cli.options.inputs import refuse
from uavrt.cli.options.kinds import Count, GroupPulses, Metres, Power, PulseWidth, TagFrequency
from uavrt.cli.options.link_budget_options import USUAL_BUDGET, Budget
from uavrt.cli.shown.outputs import print_json
from uavrt.core.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.core.messages import Tag
    from uavrt.planning.detectability.link_budget import LinkBudget

PROBABILITIES = (0.5, 0.9)
_PULSES, _FREQUENCY_HZ, _PULSE_WIDTH_S = (3, 10, 20, 40), 150e6, 0.020
_ANTENNA, _FLIGHT_PULSES = "RA-23K", 400
_TURN_DEG_S = 6.0
"""Turn rate assumed for a drone that turns in place during a whole flight [deg/s]."""


def range(
    *,
    tag_power: Power,
    height: Metres = 60.0,
    tags: Path | None = None,
    pulses: tuple[GroupPulses, ...] = _PULSES,
    frequency: TagFrequency = _FREQUENCY_HZ,
    pulse_width: PulseWidth = _PULSE_WIDTH_S,
    budget: Budget = USUAL_BUDGET,
    flight: tuple[Path, ...] = (),
    whole_flight: Annotated[bool, Parameter(negative="")] = False,
    antenna: str = _ANTENNA,
    flight_pulses: Count = _FLIGHT_PULSES,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Show the detection range of a tag for Pd .5 and .9, and the budget line by line.

    The required ENR of a group of K pulses is that of our detector, for the tag's interval,
    its uncertainty, jitter and false-alarm probability. The distances are for open ground: they
    are shorter with hills or trees, or if the animal lies on its tag.

    Parameters
    ----------
    tag_power
        Power that the tag radiates [dBm], antenna and animal included; collars: -30 to -10.
    height
        Height of the drone above the ground [m].
    tags
        A tag file: each tag with its own frequency, pulse width, interval and K. Without it
        a tag of 1.254 s ± 60 ms, at a false-alarm probability of 1 %.
    pulses
        Pulses in a group (K), without --tags.
    frequency
        The tag's frequency [Hz], without --tags.
    pulse_width
        The tag's pulse width [s], without --tags.
    flight
        A past flight: the rise of the drone's noise in the air is added to the noise. Of
        several, the median is used.
    whole_flight
        Add a row for each tag for a flight searched as a whole by uavrt integrate: the drone
        turns on the spot at 6°/s, and the gain is that of the strongest pulse.
    antenna
        Name of the antenna's pattern, or a CSV file of angles and gains, for --whole-flight.
        monopole: equal on all sides.
    flight_pulses
        Number of pulses that the tag sends in a --whole-flight.
    as_json
        Print a list of objects.
    """
    if tags is not None:
        refuse(
            {
                "--pulses": pulses != _PULSES,
                "--frequency": frequency != _FREQUENCY_HZ,
                "--pulse-width": pulse_width != _PULSE_WIDTH_S,
            },
            "{} describes a tag without a list; --tags has its own values",
        )
    if not whole_flight:
        refuse(
            {
                "--antenna": antenna != _ANTENNA,
                "--flight-pulses": flight_pulses != _FLIGHT_PULSES,
            },
            "{} applies to --whole-flight; pulse groups use --antenna-gain",
        )
    noise = [_noise(one) for one in flight]
    link = budget.link(
        power_dbm=tag_power,
        height_m=height,
        frequency_hz=frequency,
        pulse_width_s=pulse_width,
        drone_noise_db=_median_db(noise),
    )
    listed = _tags(tags, pulses, frequency, pulse_width)
    own = [
        replace(link, frequency_hz=tag.frequency_hz, pulse_width_s=tag.pulse_width_s)
        for tag in listed
    ]
    rows = [_row(tag, its) for tag, its in zip(listed, own, strict=True)]
    if whole_flight:
        each = {tag.tag_id: (tag, its) for tag, its in zip(listed, own, strict=True)}
        rows += [
            {
                "tag_id": tag.tag_id,
                "k": None,
                **_reach(_whole_flight_db(tag, antenna, flight_pulses), its),
                "antenna": antenna,
                "flight_pulses": flight_pulses,
            }
            for tag, its in each.values()
        ]
    if as_json:
        print_json([one | {"noise_from": noise} for one in rows])
    else:
        _print(rows, link, noise)


def _tags(
    path: Path | None, pulses: tuple[int, ...], frequency_hz: float, pulse_width_s: float
) -> "list[Tag]":
    from uavrt.analysis.covered.coverage_maps import assumed_tag
    from uavrt.config.tags.tag_files import read_tags

    if path is not None:
        return list(read_tags(path))
    return [
        assumed_tag(frequency_hz=frequency_hz, pulse_width_s=pulse_width_s, k=k) for k in pulses
    ]


def _row(tag: "Tag", budget: "LinkBudget") -> dict[str, Any]:
    from uavrt.detection.sensitivity import enr_needed_db

    half, most = (enr_needed_db(tag, probability) for probability in PROBABILITIES)
    return {"tag_id": tag.tag_id, "k": tag.k, **_reach((half, most), budget)}


def _whole_flight_db(tag: "Tag", antenna: str, pulses: int) -> tuple[float, float]:
    """Energy-to-noise ratio of the strongest pulse for detection [dB].

    It is given for detection probabilities of 0.5 and 0.9.
    """
    import numpy as np

    from uavrt.analysis.measure.antenna_files import antenna_named
    from uavrt.localization.antenna import pattern_named
    from uavrt.planning.detectability.whole_flight_chance import MODEL, whole_flight_enr_db

    if pulses < MODEL.least_pulses:
        raise ConfigError(
            f"{pulses} pulses are too few for a whole-flight search",
            remedy=f"Give --flight-pulses {MODEL.least_pulses} or more",
        )
    pattern = pattern_named(antenna_named(antenna))
    heading = np.arange(pulses) * tag.pulse_intervals_s[0] * _TURN_DEG_S
    gain_db = np.asarray(pattern.gain_db(heading), np.float64)
    half, most = whole_flight_enr_db(tag, gain_db, PROBABILITIES)
    return half, most


def _noise(flight: Path) -> dict[str, Any]:
    from uavrt.analysis.inputs.flight_noise import flight_noise_of

    found = flight_noise_of(flight)
    return {
        "flight": flight.resolve().name,
        "rise_db": round(found.median_db, 2),
        "over": found.quiet,
    }


def _median_db(noise: list[dict[str, Any]]) -> float:
    from statistics import median

    return round(median(one["rise_db"] for one in noise), 2) if noise else 0.0


def _reach(needed: tuple[float, float], budget: "LinkBudget") -> dict[str, Any]:
    """Distance of detection and its link budget, for detection probabilities of 0.5 and 0.9.

    Returns the required energy-to-noise ratio [dB] and the distance [m] for both, and the
    budget.
    """
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


def _print(
    rows: list[dict[str, Any]], budget: "LinkBudget", noise: list[dict[str, Any]]
) -> None:
    from rich.console import Console

    from uavrt.core.terminal_tables import table_of

    console = Console()
    titles = ("tag", "K", "ENR for Pd .5", "for Pd .9", "range, Pd .5", "Pd .9")
    height = f"Detection range from {budget.drone_height_m:g} m above the ground"
    table = table_of(*titles, left=(), title=height)
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
    for row in rows:
        what = f"K = {row['k']}"
        if row["k"] is None:
            what = f"whole flight of {row['flight_pulses']} pulses, {row['antenna']}"
        title = f"Budget of tag {row['tag_id']}, {what}, for Pd .9"
        lines = table_of("term", "value", left=("term",), title=title)
        for one in row["budget"]:
            lines.add_row(one["term"], f"{one['value']:.1f} {one['unit']}")
        console.print(lines)
    for one in noise:
        text = f"noise of the drone in {one['flight']}: +{one['rise_db']:.1f} dB in the air"
        console.print(f"{text} over {one['over']}", highlight=False, soft_wrap=True)
    if len(noise) > 1:
        console.print(f"their median is used: +{budget.drone_noise_db:.1f} dB", highlight=False)


def _far(distance_m: float | None) -> str:
    if distance_m is None:
        return "nowhere"
    return "over 100 km" if distance_m >= 100_000.0 else f"{distance_m / 1000.0:.2f} km"
