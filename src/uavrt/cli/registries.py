"""Names from the registries in help texts: ``{antennas}`` in a docstring becomes their list."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, get_args

from uavrt.cli.command_places import module_of


def _antennas() -> list[str]:
    from uavrt.localization.antenna import MONOPOLE, PATTERNS

    return [name for name in PATTERNS if name != MONOPOLE]


def _bearing_methods() -> list[str]:
    from uavrt.localization.bearing.estimate_bearing import ADDED_METHODS
    from uavrt.localization.results import BearingMethod

    return [*get_args(BearingMethod), *ADDED_METHODS]


def _position_methods() -> list[str]:
    from uavrt.localization.position.estimate_position import ADDED_METHODS
    from uavrt.localization.results import PositionMethod

    return [*get_args(PositionMethod), *ADDED_METHODS]


def _export_formats() -> list[str]:
    from uavrt.analysis.export.written import EXPORT_FORMATS

    return list(EXPORT_FORMATS)


_LISTS: dict[str, Callable[[], list[str]]] = {
    "{antennas}": _antennas,
    "{bearing_methods}": _bearing_methods,
    "{position_methods}": _position_methods,
    "{export_formats}": _export_formats,
}


def fill_help(command: str) -> None:
    """Put the registries' names into the help of a command, and of its option records.

    Called only to show help, since it imports modules that the command may not need.
    """
    module = import_module(module_of(command))
    named: list[Any] = [getattr(module, command), getattr(module, "Placing", None)]
    for one in named:
        for placeholder, names in _LISTS.items():
            if placeholder in (one.__doc__ or ""):
                one.__doc__ = one.__doc__.replace(placeholder, ", ".join(names()))
