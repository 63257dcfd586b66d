"""Compute coverage maps, which take seconds to minutes, one at a time in a thread."""

import base64
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.formats.png import chance, png_bytes

if TYPE_CHECKING:
    from uavrt.planning.detectability.detection_coverage import Coverage

log = get_logger()

Record = dict[str, Any]
OnStep = Callable[[int, int], None]
"""Function that receives the number of finished steps and their total."""
Asked = TypeVar("Asked")
Found = TypeVar("Found")
_ANOTHER = "another map was requested in the meantime. Request this map again"


@dataclass(slots=True, kw_only=True, eq=False)
class _Work(Generic[Asked, Found]):
    """A coverage map in progress or finished."""

    asked: Asked
    done: float = 0.0
    found: Found | None = None
    fault: str | None = None
    given_up: threading.Event = field(default_factory=threading.Event)


class _GivenUpError(Exception):
    """Raised in the computing thread after another map was requested."""


class MapJobs(Generic[Asked, Found]):
    """Computes coverage maps by `make`, one at a time; `record` converts them for the page."""

    def __init__(
        self,
        make: Callable[[Asked, OnStep], Found],
        record: Callable[[Found], Record],
        name: str,
    ) -> None:
        self._make, self._record, self._name = make, record, name
        self._work: _Work[Asked, Found] | None = None
        self._lock = threading.Lock()

    def answer(self, asked: Asked, *, again: bool = False) -> Record:
        """Return a map, or its progress; start to compute it if it is a new request.

        `again`: True for a repeated request. It does not restart a map that another page's
        request has replaced; otherwise two pages would interrupt each other for ever.
        """
        with self._lock:
            work = self._work
            if work is None or work.asked != asked:
                if again:
                    return {"state": "failed", "error": _ANOTHER}
                work = self._begin(asked)
            if work.fault is not None:
                self._work = None
                return {"state": "failed", "error": work.fault}
        if work.found is None:
            return {"state": "working", "done": round(work.done, 3)}
        return {"state": "done", **self._record(work.found)}

    def found(self, asked: Asked) -> Found | None:
        """Return the requested map; None until it is finished."""
        work = self._work
        return None if work is None or work.asked != asked else work.found

    def _begin(self, asked: Asked) -> _Work[Asked, Found]:
        if self._work is not None:
            self._work.given_up.set()
        self._work = work = _Work[Asked, Found](asked=asked)
        threading.Thread(target=self._run, args=(work,), name=self._name, daemon=True).start()
        return work

    def _run(self, work: _Work[Asked, Found]) -> None:
        def on_step(done: int, total: int) -> None:
            work.done = done / max(total, 1)
            if work.given_up.is_set():
                raise _GivenUpError

        try:
            work.found = self._make(work.asked, on_step)
        except _GivenUpError:
            return
        except UavrtError as error:
            work.fault = str(error)
        except Exception as error:  # a page that asks must not wait forever
            log.exception("a map could not be made; the page shows the error")
            work.fault = f"the map could not be made: {error}"


def map_record(coverage: "Coverage") -> Record:
    """Record of a map for the page: picture, position and figures."""
    ground = coverage.ground
    half = 0.5 * ground.cell_m
    west, east = float(ground.east_m[0]) - half, float(ground.east_m[-1]) + half
    south, north = float(ground.north_m[0]) - half, float(ground.north_m[-1]) + half
    latitude, longitude = ground.plane.to_geodetic(
        [west, east, east, west], [north, north, south, south]
    )
    return {
        "corners": np.stack([longitude, latitude], axis=-1).tolist(),
        "picture": base64.b64encode(png_bytes(chance(coverage.heard[::-1]))).decode(),
        **figures(coverage),
        "cell_m": ground.cell_m,
        "limitations": list(coverage.limitations),
    }


def figures(coverage: "Coverage") -> Record:
    """Mean detection probability, share of cells with at least 0.9, and mapped area [km²]."""
    return {
        "mean_probability": _known(coverage.mean),
        "share_above_90": _known(coverage.share_above(0.9)),
        "known_km2": round(coverage.known_km2, 3),
    }


def _known(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
