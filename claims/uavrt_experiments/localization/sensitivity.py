"""Sensitivity of the experiments to constants of the estimators, by common random numbers.

    python -m uavrt_experiments.localization.sensitivity L6 4 COMMON.heading_sigma_deg*1.3

runs experiment L6 with four runs, with and without the change, and prints figures that differ.
Several changes, separated by commas, are made together. The simulated worlds keep the original
constants.
"""

import importlib
import json
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

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
    for change in filter(None, changes.split(",")):
        path, factor = change.split("*")
        record, field = path.split(".")
        (owner,) = (getattr(one, record) for one in modules if hasattr(one, record))
        value = scaled(getattr(owner, field), float(factor))
        object.__setattr__(owner, field, value)
    package = importlib.import_module("uavrt.localization")
    for found in pkgutil.walk_packages(package.__path__, "uavrt.localization."):
        importlib.import_module(found.name)
    for module, record, original in originals:
        setattr(module, record, original)  # the worlds use these
    experiments = importlib.import_module("uavrt_experiments.localization.experiments")
    rows = experiments.EXPERIMENTS[name](runs, _SEED)
    return {f"{one.case}: {one.quantity}": one.figure for one in rows}


def records_of(module: ModuleType) -> Iterator[str]:
    """Names of the records of constants that a module defines."""
    for name, value in vars(module).items():
        own = type(value).__module__ == module.__name__
        if own and name.isupper() and hasattr(value, "__dataclass_fields__"):
            yield name


def compared(name: str, runs: int, changes: str) -> Iterator[str]:
    """One line for each figure that a change of constants moves, before and after."""
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


if __name__ == "__main__":
    if sys.argv[-1].startswith("="):
        sys.stdout.write(json.dumps(figures(sys.argv[1], int(sys.argv[2]), sys.argv[-1][1:])))
    else:
        for line in compared(sys.argv[1], int(sys.argv[2]), sys.argv[3]):
            sys.stdout.write(f"{line}\n")
