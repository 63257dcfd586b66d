"""``uavrt experiment detection``."""

import csv
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from uavrt.experiments.detection.run import run_detection


def detection(*, trials: int = 600, seed: int = 1, output: Path | None = None) -> None:
    """Measure the pulse detector against the original's figures and the bounds of theory.

    Parameters
    ----------
    trials
        Decisions for each point of the Pd curve; everything else in proportion.
    seed
        Seed of all signals.
    output
        Also write the table to this CSV file.
    """
    errors = Console(stderr=True)
    rows = run_detection(trials=trials, seed=seed, say=errors.print)
    table = Table(title="Detection")
    for name in ("", "case", "measured", "95 %", "n", "original", "theory, remarks"):
        table.add_column(name)
    for row in rows:
        table.add_row(
            row.experiment,
            row.case,
            f"{row.figure:.3f}",
            f"{row.low:.3f} … {row.high:.3f}",
            str(row.trials),
            row.original,
            row.theory,
        )
    Console().print(table)
    if output is not None:
        with output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, fieldnames=list(asdict(rows[0])))
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)
