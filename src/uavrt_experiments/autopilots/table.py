"""What came out of a rehearsal, as a table. Pure."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from uavrt_experiments.tables import number

OUT_WITHIN_S = 4.0
"""Of a takeover that no message reveals, or of the stop that reveals it."""
SHARE = 0.20
"""Bar: how far a simulated autopilot's median may be from the real one's."""
FIGURES = {
    "begins_s": "begins, s",
    "overshoot_m": "overshoot, m",
    "settling_s": "settling, s",
    "turn_rate_deg_s": "turning, °/s",
}
Outcome = Mapping[str, Any]
Lines = list[list[str]]


def median(values: Sequence[float]) -> float:
    """Middle of what there is; NaN of nothing."""
    ordered = sorted(values)
    half = len(ordered) // 2
    if not ordered:
        return math.nan
    return ordered[half] if len(ordered) % 2 else 0.5 * (ordered[half - 1] + ordered[half])


def rms(values: Sequence[float]) -> float:
    """Root of the mean square; NaN of nothing."""
    return math.sqrt(sum(v * v for v in values) / len(values)) if values else math.nan


def names_of(outcomes: Iterable[Outcome]) -> list[str]:
    """Builds in the order in which they were flown."""
    return list(dict.fromkeys(one["build"] for one in outcomes))


def order_lines(outcomes: Sequence[Outcome]) -> Lines:
    """Orders that nobody took over: how many ended by arrival, and how the others did."""
    lines = [["autopilot", "order", "ended by arrival", "otherwise"]]
    for name in names_of(outcomes):
        mine = [one for one in outcomes if one["build"] == name and one["takeover"] is None]
        for order in dict.fromkeys(one["order"] for one in mine):
            flown = [one for one in mine if one["order"] == order]
            ended = Counter(one.get("failed") or one["ended"] for one in flown)
            well = sum(bool(one.get("arrived")) for one in flown)
            bad = [one for one in flown if not one.get("arrived")]
            words = Counter(one.get("failed") or one["ended"] for one in bad)
            text = "; ".join(f"{count} × {what}" for what, count in words.items())
            lines.append([name, order, f"{well} of {sum(ended.values())}", text])
    return lines


def takeover_lines(outcomes: Sequence[Outcome]) -> Lines:
    """Takeovers: commands afterwards, and how fast uavrt was out."""
    heads = [
        "autopilot",
        "takeover",
        "flown",
        "commands after",
        "last command, s",
        "out, s",
        "",
    ]
    lines = [heads]
    for name in names_of(outcomes):
        mine = [one for one in outcomes if one["build"] == name and one["takeover"]]
        for takeover in dict.fromkeys(one["takeover"] for one in mine):
            flown = [one for one in mine if one["takeover"] == takeover]
            judged = [one for one in flown if "reaction" in one]
            after = sum(one["reaction"]["commands_after"] for one in judged)
            last = [
                one["reaction"]["last_command_s"]
                for one in judged
                if one["reaction"]["last_command_s"] is not None
            ]
            outs = [one["out_s"] for one in judged]
            longest = "never" if None in outs else number(max(outs)) if outs else "–"
            faults = Counter(one["failed"] for one in flown if "failed" in one)
            words = [f"{count} × {what}" for what, count in faults.items()]
            lines.append(
                [
                    *(name, takeover, str(len(judged)), str(after)),
                    *(number(max(last)) if last else "–", longest, "; ".join(words)),
                ]
            )
    return lines


def figure_lines(outcomes: Sequence[Outcome]) -> Lines:
    """How each autopilot flies: medians, and the largest of how long it takes to begin."""
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
                lines.append([name, words, number(rms(errors)), number(most), str(len(errors))])
        pulses = [one["pulses"] for one in mine if "pulses" in one]
        if pulses:
            got, sent = (sum(column) for column in zip(*pulses, strict=True))
            lines.append([name, "pulses delivered", f"{got} of {sent}", "", str(len(pulses))])
    return lines


def values_of(outcomes: Iterable[Outcome], key: str) -> list[float]:
    """All figures of a kind."""
    return [v for one in outcomes for v in one.get("flying", {}).get(key, ())]


def compared(outcomes: Sequence[Outcome], flavour_of: Callable[[str], str]) -> Lines:
    """Compare our simulated autopilots with the real ones of their kind."""
    lines = [["kind", "figure", "real", "simulated", "ratio", ""]]
    names = names_of(outcomes)
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
        if not names or not all(groups):
            continue
        for key, words in FIGURES.items():
            real, ours = (median(values_of(group, key)) for group in groups)
            ratio = ours / real if real else math.nan
            near = f"{'within' if abs(ratio - 1) <= SHARE else 'beyond'} {SHARE:.0%}"
            bar = "" if key == "begins_s" else near
            lines.append([kind, words, *map(number, (real, ours, ratio)), bar])
    return lines


def faults_in(outcomes: Sequence[Outcome]) -> list[str]:
    """What an integrator must look at."""
    found = []
    for one in outcomes:
        what = one["takeover"] or one["order"]
        if "failed" in one:
            found.append(f"{one['build']}, {what}: {one['failed']}")
        elif one["takeover"] is None and not one["arrived"]:
            found.append(f'{one["build"]}, {what}: ended by "{one["ended"]}"')
        elif one["takeover"] is not None and one["reaction"]["commands_after"]:
            count = one["reaction"]["commands_after"]
            found.append(f"{one['build']}, {what}: {count} commands after it")
        elif one["takeover"] is not None and one["out_s"] is None:
            found.append(f"{one['build']}, {what}: the order did not end")
    return found


def as_page(outcomes: Sequence[Outcome], flavour_of: Callable[[str], str]) -> str:
    """Write all tables as Markdown."""
    parts = []
    for title, lines in (
        ("Orders", order_lines(outcomes)),
        ("Takeovers", takeover_lines(outcomes)),
        ("Flying", figure_lines(outcomes)),
        ("Simulated and real", compared(outcomes, flavour_of)),
    ):
        if len(lines) > 1:
            cells = [[one.replace("|", "/") for one in line] for line in lines]
            rows = ["| " + " | ".join(line) + " |" for line in cells]
            rows.insert(1, "|---" * len(lines[0]) + "|")
            parts.append("\n".join([f"## {title}", "", *rows]))
    return "\n\n".join(parts) + "\n"


def as_json(outcomes: Sequence[Outcome], flavour_of: Callable[[str], str]) -> dict[str, Any]:
    """Get the tables' lines by their headings, and the faults."""
    tables = {
        "orders": order_lines(outcomes),
        "takeovers": takeover_lines(outcomes),
        "flying": figure_lines(outcomes),
        "compared": compared(outcomes, flavour_of),
    }
    return {
        **{
            name: [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]
            for name, lines in tables.items()
        },
        "faults": faults_in(outcomes),
    }
