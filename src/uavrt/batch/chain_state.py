"""The detectors' state on the disk, between two chunks of a cell.

It holds numbers and our own records and nothing else: reading takes only the classes named
here, so that a file that somebody else put there cannot run anything.
"""

import io
import os
import pickle
import types
from functools import lru_cache
from pathlib import Path
from typing import Any

from uavrt.errors import FormatError

MAGIC = b"uavrt chain state 2\n"
_OURS = ("uavrt.analysis.measure.", "uavrt.config.", "uavrt.detection.", "uavrt.dsp.")
_MESSAGES = "uavrt.messages"
_UNREADABLE = (
    *(pickle.UnpicklingError, EOFError, ImportError, AttributeError, LookupError),
    *(TypeError, ValueError, ArithmeticError, MemoryError),
)
"""What `pickle` raises of bytes that are cut off, and of classes that have changed."""
_OTHERS = {
    ("collections", "deque"),
    ("collections", "Counter"),
    ("itertools", "cycle"),
    ("builtins", "iter"),
    ("builtins", "set"),
    ("builtins", "frozenset"),
    ("builtins", "complex"),
    ("builtins", "slice"),
    ("builtins", "range"),
    ("numpy", "dtype"),
    ("numpy", "ndarray"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.numeric", "_frombuffer"),
    ("numpy.core.multiarray", "scalar"),
    ("numpy.core.multiarray", "_reconstruct"),
    ("numpy.core.numeric", "_frombuffer"),
}


def write_state(path: Path, place: int, chain: object) -> None:
    """Replace the file by a newer state, whole or not at all.

    Raises
    ------
    OSError
        The disk is full or not writable.
    """
    body = pickle.dumps((place, chain), protocol=5)
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        file.write(MAGIC)
        file.write(body)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)


def read_state(path: Path) -> tuple[int, Any] | None:
    """Get the place to go on from, and the detectors; None if there is no state.

    Raises
    ------
    FormatError
        It is damaged, of another version, or holds what no state of ours holds.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    remedy = "Delete it: the cell begins anew"
    if not data.startswith(MAGIC):
        raise FormatError(f"{path} is no state of this version", remedy=remedy)
    try:
        place, chain = _Reader(io.BytesIO(data[len(MAGIC) :])).load()
    except _UNREADABLE as error:
        raise FormatError(f"{path} is damaged: {error}", remedy=remedy) from error
    if not isinstance(place, int):
        raise FormatError(f"{path} is damaged: no place", remedy=remedy)
    return place, chain


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("builtins", "getattr"):
            return _method
        if "." not in name and ((module, name) in _OTHERS or _is_ours(module, name)):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} does not belong in it")


@lru_cache(maxsize=1024)
def _is_ours(module: str, name: str) -> bool:
    """Whether it is a class made in one of our packages, not something imported there."""
    if not (module.startswith(_OURS) or module == _MESSAGES):
        return False
    found = getattr(__import__(module, fromlist=[name]), name, None)
    return isinstance(found, type) and found.__module__ == module


def _method(owner: object, name: str) -> Any:
    """Get a bound method of one of our records; it stands in for `getattr`."""
    kind = type(owner)
    found = getattr(owner, name) if not name.startswith("__") else None
    if kind.__module__.startswith((*_OURS, _MESSAGES)) and isinstance(found, types.MethodType):
        return found
    raise pickle.UnpicklingError(f"{kind.__name__}.{name} does not belong in it")
