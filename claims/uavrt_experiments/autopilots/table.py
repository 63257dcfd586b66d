"""Tables of a rehearsal's outcomes, and the list of violated requirements."""

import math
import statistics
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from uavrt.simulation.vehicle.airframe import Flavour
from uavrt_experiments.statistics import rms
from uavrt_experiments.tables import markdown, number

RELAY_LATE_S = 0.5
"""Delay in the rehearsal's own relay beyond which it may have ended the order itself [s]; the
drone allows the autopilot's target report to be missing for 1 s."""
OUT_WITHIN_S = 4.0
"""Longest allowed time to the order's end after a takeover that no message reveals [s]."""
SHARE = 0.20
"""Largest allowed relative difference of a simulated autopilot's median from the real one's."""
FIGURES = {
    "begins_s": "begins, s",
    "overshoot_m": "overshoot, m",
    "settling_s": "settling, s",
    "turn_rate_deg_s": "turning, °/s",
}
Outcome = Mapping[str, Any]
Lines = list[list[str]]


def median(values: Sequence[float]) -> float:
    """Median of values; NaN for none."""
    return statistics.median(values or (math.nan,))


def flavour_of(name: str) -> Flavour:
    """Kind of autopilot, PX4 or ArduPilot, of the build with this name."""
    return "px4" if "px4" in name.lower() else "ardupilot"


def names_of(outcomes: Iterable[Outcome]) -> list[str]:
    """Names of the builds in the order in which they were flown."""
    return list(dict.fromkeys(one["build"] for one in outcomes))


def counted(words: Iterable[str]) -> str:
    """Counts of equal texts, such as "2 × done"."""
    return "; ".join(f"{count} × {what}" for what, count in Counter(words).items())


def order_lines(outcomes: Sequence[Outcome]) -> Lines:
    """Table lines on orders without a takeover: how many ended by arrival, and the ends of the
    others.
    """
    lines = [["autopilot", "order", "ended by arrival", "otherwise"]]
    for name in names_of(outcomes):
        mine = [one for one in outcomes if one["build"] == name and one["takeover"] is None]
        for order in dict.fromkeys(one["order"] for one in mine):
            flown = [one for one in mine if one["order"] == order]
            bad = [one for one in flown if not one.get("arrived")]
            well = f"{len(flown) - len(bad)} of {len(flown)}"
            lines.append([name, order, well, counted(map(_ending, bad))])
    return lines


def _ending(one: Outcome) -> str:
    """Text on an order's end, with a note if the rehearsal itself may be the cause."""
    ended = str(one.get("failed") or one["ended"])
    if one.get("relay_late_s", 0.0) <= RELAY_LATE_S:
        return ended
    return f"{ended} (the rehearsal passed frames on too late: repeat on a quiet computer)"


def takeover_lines(outcomes: Sequence[Outcome]) -> Lines:
    """Table lines on takeovers: commands that followed, and uavrt's reaction time."""
    lines = [
        ["autopilot", "takeover", "flown", "commands after", "last command, s", "out, s", ""]
    ]
    for name in names_of(outcomes):
        mine = [one for one in outcomes if one["build"] == name and one["takeover"]]
        for takeover in dict.fromkeys(one["takeover"] for one in mine):
            flown = [one for one in mine if one["takeover"] == takeover]
            reactions = [one["reaction"] for one in flown if "reaction" in one]
            after = sum(one["commands_after"] for one in reactions)
            last = [t for one in reactions if (t := one["last_command_s"]) is not None]
            outs = [one["out_s"] for one in flown if "reaction" in one]
            longest = "never" if None in outs else number(max(outs)) if outs else "–"
            text = counted(one["failed"] for one in flown if "failed" in one)
            lines.append(
                [
                    *(name, takeover, str(len(reactions)), str(after)),
                    *(number(max(last)) if last else "–", longest, text),
                ]
            )
    return lines


def figure_lines(outcomes: Sequence[Outcome]) -> Lines:
    """Table lines with each autopilot's flight characteristics: medians and largest delay."""
    lines = [["autopilot", "figure", "median", "largest", "of"]]
    for name in names_of(outcomes):
        mine = [one for one in outcomes if one["build"] == name]
        for key, words in FIGURES.items():
            values = values_of(mine, key)
            if values:
                cells = number(median(values)), number(max(values)), str(len(values))
                lines.append([name, words, *cells])
        heights = values_of(mine, "height_error_m")
        yaws = [error for one in mine for error in one.get("yaw_errors_deg", ())]
        for words, errors in (("height error, m rms", heights), ("yaw of pulses, ° rms", yaws)):
            if errors:
                most = max(map(abs, errors))
                lines.append(
                    [name, words, number(rms(errors)[0]), number(most), str(len(errors))]
                )
        late = [one["relay_late_s"] for one in mine if "relay_late_s" in one]
        if late:
            cells = number(median(late)), number(max(late)), str(len(late))
            lines.append([name, "delay in the rehearsal's relay, s", *cells])
        pulses = [one["pulses"] for one in mine if "pulses" in one]
        if pulses:
            got, sent = (sum(column) for column in zip(*pulses, strict=True))
            lines.append([name, "pulses delivered", f"{got} of {sent}", "", str(len(pulses))])
    return lines


def values_of(outcomes: Iterable[Outcome], key: str) -> list[float]:
    """Values of one flight characteristic, a key of `FIGURES`, over all flights."""
    return [v for one in outcomes for v in one.get("flying", {}).get(key, ())]


def compared(outcomes: Sequence[Outcome]) -> Lines:
    """Table lines that compare our simulated autopilots with the real ones of their kind."""
    lines = [["kind", "figure", "real", "simulated", "ratio", ""]]
    for kind in ("px4", "ardupilot"):
        groups = [
            [
                one
                for one in outcomes
                if flavour_of(one["build"]) == kind
                and one["build"].startswith("simulated") == simulated
            ]
            for simulated in (False, True)
        ]
        if not all(groups):
            continue
        for key, words in FIGURES.items():
            real, ours = (median(values_of(group, key)) for group in groups)
            ratio = ours / real if real else math.nan
            near = f"{'within' if abs(ratio - 1) <= SHARE else 'beyond'} {SHARE:.0%}"
            bar = "" if key == "begins_s" else near
            lines.append([kind, words, *map(number, (real, ours, ratio)), bar])
    return lines


def faults_in(outcomes: Sequence[Outcome]) -> list[str]:
    """One line for each flight that violates a requirement."""
    whats = [(one, _fault_in(one)) for one in outcomes]
    return [
        f"{one['build']}, {one['takeover'] or one['order']}: {what}"
        for one, what in whats
        if what
    ]


def _fault_in(one: Outcome) -> str | None:
    if "failed" in one:
        return str(one["failed"])
    if one["takeover"] is None:
        return None if one["arrived"] else f'ended by "{_ending(one)}"'
    reaction, out_s = one["reaction"], one["out_s"]
    if reaction["commands_after"]:
        return f"{reaction['commands_after']} commands after it"
    if out_s is None:
        return "the order did not end"
    if reaction["shown_s"] is None and out_s > OUT_WITHIN_S:
        return f"no message shows it, and the order ended only {out_s:.1f} s after it"
    return None


def tables_of(outcomes: Sequence[Outcome]) -> dict[str, Lines]:
    """All tables, each with its headings first."""
    return {
        "orders": order_lines(outcomes),
        "takeovers": takeover_lines(outcomes),
        "flying": figure_lines(outcomes),
        "compared": compared(outcomes),
    }


def as_page(outcomes: Sequence[Outcome]) -> str:
    """Write all tables as Markdown."""
    return "\n".join(
        f"## {name.capitalize()}\n\n{markdown(lines)}\n"
        for name, lines in tables_of(outcomes).items()
        if len(lines) > 1
    )


def as_json(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Get the tables' lines by their headings, and the violations, for JSON."""
    lines_by_heading = {
        name: [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]
        for name, lines in tables_of(outcomes).items()
    }
    return lines_by_heading | {"faults": faults_in(outcomes)}
