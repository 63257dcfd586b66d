"""Compiled kernels, optional, for operations several times slower in NumPy.

They come from ``native/kernels.c``: a wheel without them, or ``UAVRT_PURE=1`` in the
environment, uses the NumPy code of each call, which gives the same pulses
(docs/decisions/0166).
"""

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

INTERFACE = 6
"""Version of the kernels' arguments; those of an older build are not used."""


def _load() -> tuple[Any, str]:
    """Load the kernels if there are any, with a description."""
    if os.environ.get("UAVRT_PURE", "0") not in ("", "0"):
        return None, "NumPy alone, as UAVRT_PURE says"
    try:
        module = importlib.import_module("uavrt._native")
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError):
            return None, "NumPy alone (this installation has no compiled kernels)"
        return None, f"NumPy alone (compiled kernels cannot be loaded: {error})"
    found = getattr(module, "INTERFACE", None)
    if found != INTERFACE:
        return None, f"NumPy alone (compiled kernels of another version: {found})"
    return module, f"compiled kernels for {module.BUILT}, {module.choose('avx512')}"


_kernels, _said = _load()


def kernels() -> Any:
    """Get the module of the kernels, or None if NumPy does all."""
    return _kernels


def description() -> str:
    """Name briefly which code is in use."""
    return _said


@contextmanager
def numpy_only() -> Iterator[None]:
    """Do not use the kernels for a while, to compare, in tests and benchmarks."""
    global _kernels
    kept, _kernels = _kernels, None
    try:
        yield
    finally:
        _kernels = kept
