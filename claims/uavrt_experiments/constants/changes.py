"""Constants of localization by name and kind, their changes, and the record of their use.

A process changes constants before it imports the estimators, since some modules compute tables
from them. The simulated worlds keep the original constants.
"""

import importlib
import pkgutil
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from types import ModuleType
from typing import Any, get_args, get_type_hints

from uavrt.core.errors import UsageError

TUNING = (
    "uavrt.localization.tuning",
    "uavrt.localization.bearing.tuning",
    "uavrt.localization.position.tuning",
    "uavrt.localization.whole_flight.tuning",
)
_TRACKERS = "uavrt.localization.position.trackers"
PRIOR = "TagPrior"
"""Class of the trackers whose defaults are constants too."""
_OF_PRIOR = (
    "level_db",
    "level_sigma_db",
    "walking_m_per_root_s",
    "travelling_m_s",
    "turning_m_s_per_root_s",
    "motion",
    "exponent",
    "shadowing_db",
)
TUNED = "tuned"
_NEUTRAL = ("0", "0.0", "1")
"""Values that stand for nothing, such as no error."""


def scaled(value: Any, factor: float) -> Any:
    """Number, or all numbers of a tuple, times a factor; a count changes by at least one."""
    if isinstance(value, tuple):
        return tuple(scaled(one, factor) for one in value)
    if isinstance(value, int):
        changed = round(value * factor)
        return changed if changed != value else value + (1 if factor > 1.0 else -1)
    return value * factor


def records_of(module: ModuleType) -> Iterator[str]:
    """Names of the records of constants that a module defines."""
    for name, value in vars(module).items():
        own = type(value).__module__ == module.__name__
        if own and name.isupper() and is_dataclass(value):
            yield name


def records() -> dict[str, Any]:
    """All records of constants by name."""
    return {
        name: getattr(module, name)
        for module in map(importlib.import_module, TUNING)
        for name in records_of(module)
    }


def constants() -> dict[str, str]:
    """Kind of each constant by its name, such as ``LEVELS.exponent``."""
    found = {}
    for name, record in records().items():
        hints = get_type_hints(type(record), include_extras=True)
        for field in fields(record):
            value = getattr(record, field.name)
            kind = next(
                (one for one in get_args(hints[field.name]) if isinstance(one, str)), ""
            )
            if is_dataclass(value) and not kind:
                parts = get_type_hints(type(value), include_extras=True)
                for part in fields(value):
                    guard = any(isinstance(one, str) for one in get_args(parts[part.name]))
                    if repr(getattr(value, part.name)) not in _NEUTRAL or guard:
                        path = f"{name}.{field.name}.{part.name}"
                        found[path] = "guard" if guard else TUNED
            else:
                found[f"{name}.{field.name}"] = kind or TUNED
    return found | {f"{PRIOR}.{name}": TUNED for name in _OF_PRIOR}


def change(paths: Sequence[str], factor: float) -> None:
    """Multiply constants by a factor, and import the estimators with them.

    Raises `UsageError`: a name is unknown.
    """
    modules = [importlib.import_module(one) for one in TUNING]
    known = records()
    originals = [
        (module, name, replace(known[name]))
        for module in modules
        for name in records_of(module)
    ]
    for path in paths:
        if path not in constants():
            raise UsageError(
                f"there is no constant {path}",
                remedy="Write RECORD.field, such as COMMON.heading_sigma_deg; the records are "
                f"{', '.join(sorted({one.partition('.')[0] for one in constants()}))}",
            )
        record, *within = path.split(".")
        if record == PRIOR:
            continue
        owner, field = known[record], within[0]
        value = getattr(owner, field)
        value = (
            replace(value, **{within[1]: scaled(getattr(value, within[1]), factor)})
            if len(within) > 1
            else scaled(value, factor)
        )
        object.__setattr__(owner, field, value)
    package = importlib.import_module("uavrt.localization")
    for found in pkgutil.walk_packages(package.__path__, "uavrt.localization."):
        importlib.import_module(found.name)
    defaults = importlib.import_module(_TRACKERS).TagPrior.__init__.__kwdefaults__
    for path in paths:
        record, _, field = path.partition(".")
        if record == PRIOR:
            defaults[field] = scaled(defaults[field], factor)
    for module, name, original in originals:
        setattr(module, name, original)  # the worlds use these


def watch(reads: set[str]) -> None:
    """Add the name of each constant that is read from now on to a set.

    Call before `change`: modules that are imported already may have copied a constant.
    """
    for name, record in records().items():

        def read(owner: Any, field: str, name: str = name) -> Any:
            value = object.__getattribute__(owner, field)
            if not field.startswith("_"):
                reads.add(f"{name}.{field}")
            return value

        own = {"__slots__": (), "__getattribute__": read}
        watched = type(type(record).__name__, (type(record),), own)
        object.__setattr__(record, "__class__", watched)


def watch_prior(reads: set[str]) -> None:
    """Add the names of the defaults that each prior of a tracker uses to a set."""
    prior = importlib.import_module(_TRACKERS).TagPrior
    made = prior.__init__

    def make(self: Any, **given: Any) -> None:
        reads.update(f"{PRIOR}.{name}" for name in _OF_PRIOR if name not in given)
        made(self, **given)

    prior.__init__ = make
