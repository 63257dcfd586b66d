"""The command ``uavrt experiment capacity``."""

import asyncio
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.cli.options.kinds import Counts
from uavrt.cli.shown.outputs import check_place, print_json
from uavrt.core.errors import ConfigError, needs_extra
from uavrt_experiments.capacity.links import LinkRow, run_links
from uavrt_experiments.capacity.model import CapacityRow, model_row, our_sender_row
from uavrt_experiments.capacity.thesis import COUNTS, GAPS_MS
from uavrt_experiments.tables import drawn


def capacity(
    *,
    link: str | None = None,
    ground_link: str | None = None,
    counts: Counts = COUNTS,
    picture: Annotated[Path | None, Parameter(name="--plot")] = None,
    json_summary: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Send series of packets through an autopilot, 0 to 10 ms apart (thesis §5.4).

    The simulated autopilot is compared with Tables 5.10 to 5.13; then our sender is tested.
    Exits with 1 when the tables are not reproduced or our sender loses a packet.

    Parameters
    ----------
    link
        Companion link of a real autopilot or SITL to test instead: udpin://127.0.0.1:14540.
    ground_link
        Its ground link: udpin://127.0.0.1:14550.
    counts
        Numbers of packets in a series.
    picture
        Also plot it, as PNG or SVG (needs the extra uavrt[analysis]).
    json_summary
        Print one JSON object as the last line.
    """
    if (link is None) != (ground_link is None):
        raise ConfigError(
            "both ends of the link are needed", remedy="Give --link and --ground-link"
        )
    if not counts:
        raise ConfigError(
            "a series needs at least one packet", remedy="Give --counts of 1 or more"
        )
    if picture is not None:
        check_place(picture, overwrite=True)
        if picture.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise ConfigError(f"{picture} is not a picture file", remedy="Name it .png or .svg")
    rows = [model_row(count, gap_ms) for count in counts for gap_ms in GAPS_MS]
    ours = [our_sender_row(count, gap_s) for count in counts for gap_s in (0.012, 0.020)]
    real: list[LinkRow] = []
    if link is not None and ground_link is not None:
        real = asyncio.run(run_links(link, ground_link, counts, GAPS_MS))
    results = [row.result for row in rows] + [row.ours for row in ours]
    results += [row.result for row in real]
    if json_summary:
        tables = {
            "model": [asdict(row) for row in rows],
            "ours": [asdict(row) for row in ours],
            "link": [asdict(row) for row in real],
        }
        print_json(tables)
    else:
        print(drawn(results))
    if picture is not None:
        _draw(rows, picture)
    sys.exit(0 if all(row.met for row in results) else 1)


def _draw(rows: list[CapacityRow], picture: Path) -> None:
    """Plot the share of dropped packets over the gap, as the thesis's Figure 5.11."""
    with needs_extra("analysis", "--plot"):
        from matplotlib.figure import Figure
    figure = Figure(figsize=(8, 5))
    axes = figure.subplots()
    for count in sorted({row.sent for row in rows}):
        series = [row for row in rows if row.sent == count]
        gaps = [row.gap_ms for row in series]
        shares = [100 * (1 - row.received / row.sent) for row in series]
        (line,) = axes.plot(gaps, shares, label=f"{count} packets")
        known = [row for row in series if row.thesis is not None]
        published = [100 * (1 - (row.thesis or 0) / row.sent) for row in known]
        color = line.get_color()
        axes.plot([r.gap_ms for r in known], published, "o", color=color, fillstyle="none")
    axes.set(xlabel="gap [ms]", ylabel="dropped [%]", title="Lines: simulated; circles: thesis")
    axes.legend()
    figure.savefig(picture)
