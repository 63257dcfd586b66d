"""Import scipy.fft and scipy.special without loading unused parts of NumPy.

On import, SciPy 1.17 copies all names of NumPy, which loads numpy.f2py and numpy.testing: 6 MB
and 0.05 s in a process of the drone that needs neither. Empty modules replace these two during
the import; a later use loads the real modules.
"""

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy import fft, special

__all__ = ["fft", "special"]


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


def __getattr__(name: str) -> ModuleType:
    if name not in __all__:
        raise AttributeError(name)
    try:
        with _without_tools():
            return importlib.import_module(f"scipy.{name}")
    except ImportError:  # a SciPy that needs these tools itself
        return importlib.import_module(f"scipy.{name}")
