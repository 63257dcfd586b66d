"""Compiled kernels for what NumPy does at several times the price, where they are installed.

They come from ``native/kernels.c`` and are optional: a wheel without them, or
``UAVRT_PURE=1`` in the environment, takes the NumPy code beside each call, which gives the same
pulses (docs/decisions/0166).
"""

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

INTERFACE = 6
"""What the kernels' arguments are: others, left from an older build, are not used."""


def _load() -> tuple[Any, str]:
    """Get the kernels if there are any, and what to say of them."""
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
    """Get the module of the kernels, or None where NumPy does all."""
    return _kernels


def description() -> str:
    """Name briefly which code is in use."""
    return _said


@contextmanager
def numpy_only() -> Iterator[None]:
    """Leave the kernels aside for a while: to compare, in tests and benchmarks."""
    global _kernels
    kept, _kernels = _kernels, None
    try:
        yield
    finally:
        _kernels = kept
