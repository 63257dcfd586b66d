"""scipy.special, without the tools of NumPy that it would load as well.

SciPy 1.17 copies everything that NumPy has when scipy.special is imported, so numpy.f2py and
numpy.testing are loaded: 6 MB and 0.05 s in a process of the drone that needs neither. Empty
modules stand in for these two meanwhile; what asks for them later gets the true ones.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np

__all__ = ["special"]


@contextmanager
def _without_tools() -> Iterator[None]:
    empty = {
        name: ModuleType(f"numpy.{name}")
        for name in ("f2py", "testing")
        if f"numpy.{name}" not in sys.modules
    }
    for name, module in empty.items():
        sys.modules[module.__name__] = module
        setattr(np, name, module)
    try:
        yield
    finally:
        for name, module in empty.items():
            del sys.modules[module.__name__]
            delattr(np, name)


with _without_tools():
    from scipy import special
