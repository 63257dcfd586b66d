"""Sensitivity of the experiments to constants of the estimators, by common random numbers.

    python -m uavrt_experiments.localization.sensitivity L6 4 COMMON.heading_sigma_deg*1.3

runs experiment L6 with four runs, with and without the change, and prints figures that differ.
Several changes, separated by commas, are made together. The simulated worlds keep the original
constants.
"""

import argparse
import importlib
import json
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

from uavrt.core.errors import UsageError

TUNING = (
    "uavrt.localization.tuning",
    "uavrt.localization.bearing.tuning",
    "uavrt.localization.position.tuning",
    "uavrt.localization.whole_flight.tuning",
)
MODULE = "uavrt_experiments.localization.sensitivity"
_SEED = 3


def scaled(value: Any, factor: float) -> Any:
    """Number, or all numbers of a tuple, times a factor; a count changes by at least one."""
    if isinstance(value, tuple):
        return tuple(scaled(one, factor) for one in value)
    if isinstance(value, int):
        changed = round(value * factor)
        return changed if changed != value else value + (1 if factor > 1.0 else -1)
    return value * factor


def figures(name: str, runs: int, changes: str) -> dict[str, float]:
    """Figures of an experiment by case and quantity, with constants changed."""
    modules = [importlib.import_module(one) for one in TUNING]
    originals = [
        (module, record, replace(getattr(module, record)))
        for module in modules
        for record in records_of(module)
    ]
    for owner, field, factor in _parsed(changes):
        object.__setattr__(owner, field, scaled(getattr(owner, field), factor))
    package = importlib.import_module("uavrt.localization")
    for found in pkgutil.walk_packages(package.__path__, "uavrt.localization."):
        importlib.import_module(found.name)
    for module, record, original in originals:
        setattr(module, record, original)  # the worlds use these
    experiments = importlib.import_module("uavrt_experiments.localization.experiments")
    rows = experiments.EXPERIMENTS[name](runs, _SEED)
    return {f"{one.case}: {one.quantity}": one.figure for one in rows}


def _parsed(changes: str) -> Iterator[tuple[Any, str, float]]:
    """Record, field and factor of each change; raises `UsageError`."""
    records = {
        name: getattr(module, name)
        for module in map(importlib.import_module, TUNING)
        for name in records_of(module)
    }
    for change in filter(None, changes.split(",")):
        path, _, factor = change.partition("*")
        record, _, field = path.partition(".")
        try:
            getattr(records[record], field)
            yield records[record], field, float(factor)
        except (KeyError, AttributeError, ValueError):
            raise UsageError(
                f"{change} is not a change of a constant",
                remedy="Write RECORD.field*factor, such as COMMON.heading_sigma_deg*1.3; "
                f"the records are {', '.join(sorted(records))}",
            ) from None


def records_of(module: ModuleType) -> Iterator[str]:
    """Names of the records of constants that a module defines."""
    for name, value in vars(module).items():
        own = type(value).__module__ == module.__name__
        if own and name.isupper() and hasattr(value, "__dataclass_fields__"):
            yield name


def compared(name: str, runs: int, changes: str) -> Iterator[str]:
    """One line for each figure that a change of constants moves, then a count."""
    before, after = (
        json.loads(
            subprocess.run(
                [sys.executable, "-m", MODULE, name, str(runs), f"={each}"],
                check=True,
                capture_output=True,
            ).stdout
        )
        for each in ("", changes)
    )
    for case, figure in before.items():
        if figure != after[case]:
            yield f"{case}: {figure:.4g} -> {after[case]:.4g}"
    moved = sum(figure != after[case] for case, figure in before.items())
    yield f"{moved} of {len(before)} figures change"


def main() -> None:
    """Run the command line, or one of the two runs that it compares."""
    parser = argparse.ArgumentParser(
        prog=f"python -m {MODULE}", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("experiment", help="such as L6")
    parser.add_argument("runs", type=int, help="simulated turns or surveys of each condition")
    parser.add_argument("changes", help="such as COMMON.heading_sigma_deg*1.3")
    asked = parser.parse_args()
    if asked.changes.startswith("="):
        # The experiments may not be imported before the constants are changed.
        found = figures(asked.experiment, asked.runs, asked.changes[1:])
        sys.stdout.write(json.dumps(found))
        return
    known = importlib.import_module("uavrt_experiments.localization.experiments").EXPERIMENTS
    names = [key for key in known if asked.experiment in key.split(", ")]
    if not names:
        parser.error(
            f"there is no experiment {asked.experiment}. Choose from {', '.join(known)}"
        )
    try:
        list(_parsed(asked.changes))
    except UsageError as error:
        parser.error(str(error))
    for line in compared(names[0], asked.runs, asked.changes):
        sys.stdout.write(f"{line}\n")


if __name__ == "__main__":
    main()
