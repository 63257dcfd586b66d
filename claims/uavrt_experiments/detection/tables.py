"""Files of result rows: JSON to continue from, CSV and Markdown to read."""

import json
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from uavrt.core.errors import ConfigError
from uavrt_experiments.detection.catalogue import EXPERIMENTS
from uavrt_experiments.result import Row
from uavrt_experiments.tables import HEADER, bars_kept, cells, write_csv

RESULTS = "results.json"
FOLDERS = ("detection", "dsp")
"""Folders of the package whose code the figures depend on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Origin of rows: trials, seed, code and machine."""

    version: str
    seed: int
    trials: int
    """Decisions for each point of a Pd curve."""
    measured: str = ""
    """Commit, date, machine and code digest, as in `uavrt_experiments.measured`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """All available rows, and the origin of each experiment's rows."""

    rows: tuple[Row, ...]
    origins: dict[str, Origin]

    def merged(self, other: "Results") -> "Results":
        """Combine with other results; their experiments replace those of the same name."""
        rows = [row for row in self.rows if row.experiment not in other.origins]
        order = list(EXPERIMENTS)
        both = sorted([*rows, *other.rows], key=lambda row: order.index(row.experiment))
        return Results(rows=tuple(both), origins=self.origins | other.origins)


def as_json(results: Results) -> dict[str, Any]:
    """Convert for `json.dumps`; numbers that JSON cannot represent become null."""
    return {
        "origins": {name: asdict(origin) for name, origin in sorted(results.origins.items())},
        "rows": [
            {key: _plain(value) for key, value in asdict(row).items()}
            | {"bar": row.bar, "verdict": row.verdict}
            for row in results.rows
        ],
    }


def _plain(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_results(path: Path) -> Results:
    """Read results of earlier runs; empty if the file does not exist.

    Raises `ConfigError`: the file does not contain results.
    """
    if not path.exists():
        return Results(rows=(), origins={})
    names = {field.name for field in fields(Row)}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        rows = []
        for entry in found["rows"]:
            values = {key: value for key, value in entry.items() if key in names}
            for end, infinite in (("low", -math.inf), ("high", math.inf), ("figure", math.nan)):
                values[end] = infinite if values[end] is None else values[end]
            if values["experiment"] in EXPERIMENTS:
                rows.append(Row(**values))
        origins = {name: Origin(**origin) for name, origin in found["origins"].items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(
            f"{path} holds no results of this experiment ({error})",
            remedy="Give another --output-dir, or delete the file",
        ) from error
    return Results(rows=tuple(rows), origins=origins)


def write_results(directory: Path, results: Results) -> list[Path]:
    """Write results as JSON, CSV and Markdown; returns the paths."""
    directory.mkdir(parents=True, exist_ok=True)
    paths = [directory / RESULTS, directory / "results.csv", directory / "results.md"]
    paths[0].write_text(json.dumps(as_json(results), indent=1) + "\n", encoding="utf-8")
    write_csv(
        paths[1],
        ("experiment", "quantity", "case", *HEADER),
        ((r.experiment, r.quantity, r.case, *cells(r)) for r in results.rows),
    )
    paths[2].write_text(markdown(results), encoding="utf-8")
    return paths


def markdown(results: Results) -> str:
    """Format the whole table as a Markdown page."""
    parts = [
        "# Results: detection",
        "Written by `uavrt experiment detection`. The measured value decides whether a bar "
        "(requirement) is met; the table notes bars inside the 95 % interval.",
        f"{bars_kept(results.rows)}.",
    ]
    for name, experiment in EXPERIMENTS.items():
        rows = [row for row in results.rows if row.experiment == name]
        if not rows:
            continue
        origin = results.origins[name]
        lines = ["| " + " | ".join(("quantity", "case", *HEADER)) + " |"]
        lines.append("| --- | --- " + "| ---: " * 4 + "| --- | ---: | --- | --- |")
        lines += [
            "| " + " | ".join((row.quantity, row.case, *cells(row))) + " |" for row in rows
        ]
        parts += [
            f"## {name}: {experiment.title}",
            f"Version {origin.version}, {origin.trials} trials for each point of a Pd curve, "
            f"seed {origin.seed}.",
            *([origin.measured] if origin.measured else []),
            "\n".join(lines),
        ]
    return "\n\n".join(parts) + "\n"
