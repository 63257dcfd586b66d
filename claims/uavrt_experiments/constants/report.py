"""Tables of screened constants, in Markdown."""

from collections import Counter
from collections.abc import Sequence

from uavrt_experiments.constants.changes import TUNED, constants
from uavrt_experiments.constants.screening import Effect, Screened


def kinds_line() -> str:
    """Number of constants of each kind, as a sentence."""
    kinds = Counter(constants().values())
    others = ", ".join(
        f"{count} {kind}" for kind, count in kinds.most_common() if kind != TUNED
    )
    return f"{sum(kinds.values())} constants: {kinds[TUNED]} tuned, {others}."


def table(screened: Sequence[Screened]) -> str:
    """Markdown table with a line for each group or constant, and its largest effect."""
    lines = ["| constants | simulations | result | largest effect |", "|---|---|---|---|"]
    for one in screened:
        name = f"`{one.name}`" if one.constants == (one.name,) else one.name
        effect = next(iter(one.largest()), None)
        lines.append(f"| {name} | {one.judges} | {one.verdict} | {_told(effect)} |")
    return "\n".join(lines)


def _told(effect: Effect | None) -> str:
    if effect is None or effect.before == effect.after:
        return "none"
    return str(effect)
