"""Run ``uavrt integrate`` on whole flights for the page, in a process of its own, as it uses a
core for up to a minute and up to a gigabyte of memory.
"""

import asyncio
import base64
from pathlib import Path
from typing import Any

import numpy as np

from uavrt.flight.integrated import read_folds
from uavrt.formats.png import chance, png_bytes
from uavrt.ground.web.work.report_jobs import run_uavrt

Record = dict[str, Any]
_NONE_FOUND = 1
"""Exit code of ``uavrt integrate`` when no tag was found."""
_SIGMAS = (-1.0, 6.0)
"""Range of folded energies in a picture, from dark blue to yellow [standard deviations]."""
_LARGER = 4
"""Pixels per cell in each direction of a picture with folded energies."""


class IntegrationJobs:
    """Searches whole flights for weak tags, one flight at a time, and reports the progress."""

    def __init__(self) -> None:
        self._flight: Path | None = None
        self._work: asyncio.Task[str | None] | None = None

    async def answer(self, flight: Path, dem: str) -> Record:
        """Start the search of a flight, or return its progress; an empty `dem` means level
        ground.
        """
        if self._work is None:
            self._flight = flight
            self._work = asyncio.create_task(_run_integrate(flight, dem))
        await asyncio.wait([self._work], timeout=0.2)
        if not self._work.done():
            return {"state": "working", "flight": self._flight and self._flight.name}
        fault, judged = self._work.result(), self._flight
        self._work = self._flight = None
        if judged != flight:
            return {"state": "working", "flight": judged and judged.name}
        return {"state": "done"} if fault is None else {"state": "failed", "error": fault}


async def _run_integrate(flight: Path, dem: str) -> str | None:
    """Run ``uavrt integrate``; return its error text, None if it succeeds."""
    code, text = await run_uavrt("integrate", str(flight), *(("--dem", dem) if dem else ()))
    return (
        None
        if code in (0, _NONE_FOUND)
        else text or "the search of the flight for weak signals failed"
    )


def fold_pictures(flight: Path) -> dict[str, Record]:
    """Draw a flight's samples folded at its tags' intervals, one picture per tag."""
    pictures = {}
    for one in read_folds(flight):
        cells = np.asarray(one.raster, np.float32)
        low, high = _SIGMAS
        share = np.clip((cells - low) / (high - low), 0.0, 1.0)
        large = share.repeat(_LARGER, axis=0).repeat(_LARGER, axis=1)
        picture = base64.b64encode(png_bytes(chance(large))).decode()
        pictures[str(one.tag_id)] = {"picture": picture, "interval_s": one.interval_s}
    return pictures
