"""Names of a package that are imported when they are first used.

Other packages import from a package, not from its modules, so that these can be moved and
split. Were all of them imported with the package, each process of the drone would load all of
it; so they are imported one by one, when they are asked for (PEP 562).
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazily(package: str, where: Mapping[str, str]) -> Callable[[str], Any]:
    """Make the ``__getattr__`` of a package.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    where : mapping of str to str
        For each name the module that holds it: below the package, or from ``uavrt`` on.

    Returns
    -------
    callable
        Imports the module of a name, and keeps the name in the package.
    """

    def get(name: str) -> Any:
        module = where.get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        full = module if module.startswith("uavrt") else f"{package}.{module}"
        value = getattr(import_module(full), name)
        setattr(sys.modules[package], name, value)
        return value

    return get
