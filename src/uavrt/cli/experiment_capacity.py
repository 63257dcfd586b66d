"""``uavrt experiment capacity``."""

import asyncio
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from uavrt.cli.outputs import check_place
from uavrt.errors import ConfigError
from uavrt.experiments.capacity import (
    COUNTS,
    GAPS_MS,
    CapacityRow,
    model_row,
    our_sender_row,
    run_links,
)
from uavrt.experiments.capacity.links import LinkRow


def capacity(
    *,
    link: str | None = None,
    ground_link: str | None = None,
    counts: tuple[int, ...] = COUNTS,
    picture: Annotated[Path | None, Parameter(name="--plot")] = None,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Send series of packets through an autopilot, 0 to 10 ms apart (thesis §5.4).

    First the simulated autopilot, beside Tables 5.10 to 5.13, then our sender. Exits with 1
    when the tables are not reproduced or our sender loses one.

    Parameters
    ----------
    link
        Companion link of a real autopilot or SITL to repeat it with: udpin://127.0.0.1:14540.
    ground_link
        Its ground link: udpin://127.0.0.1:14550.
    counts
        Numbers of packets in a series.
    picture
        Also draw it, as PNG or SVG (needs the extra uavrt[analysis]).
    json_summary
        Print one JSON object as the last line.
    """
    if (link is None) != (ground_link is None):
        raise ConfigError(
            "both ends of the way are needed", remedy="Give --link and --ground-link"
        )
    if min(counts, default=0) < 1:
        raise ConfigError("a series of no packets", remedy="Give --counts of 1 or more")
    if picture is not None:
        check_place(picture, overwrite=True)
        if picture.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise ConfigError(f"{picture} is no picture", remedy="Name it .png or .svg")
    rows = [model_row(count, gap_ms) for count in counts for gap_ms in GAPS_MS]
    ours = [our_sender_row(count, gap_s) for count in counts for gap_s in (0.012, 0.020)]
    real: list[LinkRow] = []
    if link is not None and ground_link is not None:
        real = asyncio.run(run_links(link, ground_link, counts, GAPS_MS))
    if json_summary:
        tables = {
            "model": [asdict(row) for row in rows],
            "ours": [asdict(row) for row in ours],
            "link": [asdict(row) for row in real],
        }
        print(json.dumps(tables))
    else:
        _show(rows, ours, real)
    if picture is not None:
        _draw(rows, picture)
    good = all(row.reproduced for row in rows) and all(r.received == r.sent for r in ours)
    good = good and all(row.received == row.sent for row in real if row.ours)
    sys.exit(0 if good else 1)


def _show(rows: list[CapacityRow], ours: list[CapacityRow], real: list[LinkRow]) -> None:
    console = Console()
    table = Table("sent", "gap ms", "received", "dropped by autopilot", "thesis", "")
    for row in rows:
        thesis = "" if row.thesis is None else str(row.thesis)
        table.add_row(
            *map(str, (row.sent, row.gap_ms, row.received, row.dropped_by_autopilot)),
            thesis,
            "" if row.reproduced else "differs",
        )
    console.print(table)
    table = Table("sent", "gap ms", "received", "dropped", title="our sender")
    for row in ours:
        numbers = (row.sent, round(row.gap_ms), row.received, row.dropped_by_autopilot)
        table.add_row(*map(str, numbers))
    console.print(table)
    if real:
        names = ("sent", "gap ms", "received", "not taken", "damaged", "by the autopilot")
        table = Table(*names, title="through the link")
        for item in real:
            gap = f"{item.gap_ms}, our sender" if item.ours else str(item.gap_ms)
            counts = (item.received, item.not_taken, item.damaged, item.between)
            table.add_row(str(item.sent), gap, *map(str, counts))
        console.print(table)


def _draw(rows: list[CapacityRow], picture: Path) -> None:
    """Share dropped over the gap, as Figure 5.11."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ConfigError(
            "there is no matplotlib", remedy="pip install 'uavrt[analysis]'"
        ) from error
    figure = Figure(figsize=(8, 5))
    axes = figure.subplots()
    for count in sorted({row.sent for row in rows}):
        series = [row for row in rows if row.sent == count]
        gaps = [row.gap_ms for row in series]
        shares = [100 * (1 - row.received / row.sent) for row in series]
        (line,) = axes.plot(gaps, shares, label=f"{count} packets")
        known = [row for row in series if row.thesis is not None]
        told = [100 * (1 - (row.thesis or 0) / row.sent) for row in known]
        color = line.get_color()
        axes.plot([r.gap_ms for r in known], told, "o", color=color, fillstyle="none")
    axes.set(xlabel="gap [ms]", ylabel="dropped [%]", title="Lines: simulated; circles: thesis")
    axes.legend()
    figure.savefig(picture)
