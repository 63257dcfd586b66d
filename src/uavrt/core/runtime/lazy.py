"""Import names of the documented API when they are first used (PEP 562).

Without this, each process of the drone would load the whole package. Modules inside uavrt
import a name directly from the module that defines it.
"""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazily(package: str, where: Mapping[str, str]) -> tuple[list[str], Callable[[str], Any]]:
    """Create ``__all__`` and ``__getattr__`` of a package; `where`: names by their module."""
    module_of = {name: module for module, names in where.items() for name in names.split()}

    def get(name: str) -> Any:
        module = module_of.get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        full = module if module.startswith("uavrt") else f"{package}.{module}"
        value = getattr(import_module(full), name)
        setattr(sys.modules[package], name, value)
        return value

    return sorted(module_of), get
