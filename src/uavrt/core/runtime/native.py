"""Optional compiled kernels for operations that are several times slower in NumPy.

They are compiled from ``native/kernels.c``. Without them, or with ``UAVRT_PURE=1`` in the
environment, NumPy code is used, which gives equal pulses (docs/decisions/0166).
"""

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

INTERFACE = 7
"""Version of the interface to the compiled kernels; kernels of another version are not used."""


def _load() -> tuple[Any, str]:
    if os.environ.get("UAVRT_PURE", "0") not in ("", "0"):
        return None, "NumPy only, because UAVRT_PURE is set"
    try:
        module = importlib.import_module("uavrt.core._native")
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError):
            return None, "NumPy only (this installation has no compiled kernels)"
        return None, f"NumPy only (compiled kernels cannot be loaded: {error})"
    found = getattr(module, "INTERFACE", None)
    if found != INTERFACE:
        return None, f"NumPy only (compiled kernels of another version: {found})"
    return module, f"compiled kernels for {module.BUILT}, {module.choose('avx512')}"


_kernels, _said = _load()


def kernels() -> Any:
    """Module with the compiled kernels; None if NumPy code is used."""
    return _kernels


def description() -> str:
    """Text that says whether compiled kernels or NumPy code is in use."""
    return _said


@contextmanager
def numpy_only() -> Iterator[None]:
    """Context that uses NumPy instead of the kernels, to compare both in tests."""
    global _kernels
    kept, _kernels = _kernels, None
    try:
        yield
    finally:
        _kernels = kept
