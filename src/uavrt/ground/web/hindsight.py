"""What is said of a flight after it: by a whole flight's samples, and by silence.

Both are made by the functions of ``uavrt integrate`` and ``uavrt coverage``. A map of where a
tag would have been heard takes seconds to a minute: it is made in a thread, one at a time, and
asked for again until it is there.
"""

import base64
import math
import threading
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavrt import analysis, planning
from uavrt.analysis.export import chance, png_bytes
from uavrt.errors import FormatError, UavrtError, UsageError
from uavrt.ground.store import AntennaChoice
from uavrt.recording import read_flight, read_integrated
from uavrt.terrain import open_elevation

if TYPE_CHECKING:
    from uavrt.analysis import SilentMap

Record = dict[str, Any]
_MOST_PULSES = 3000
_MOST_CORNERS = 500
_POWER_DBM = (-100.0, 40.0)


def integrated_record(flight: Path) -> Record:
    """Verdicts of a whole flight, and the pulses seen in hindsight, evenly thinned.

    Raises
    ------
    FormatError
        What lies beside the flight is damaged.
    """
    verdicts, pulses = read_integrated(flight)
    placed = [one for one in pulses if one.pose is not None]
    step = max(1, math.ceil(len(placed) / _MOST_PULSES))
    return {
        "tags": [asdict(one) for one in verdicts],
        "pulses": [
            {
                "tag_id": one.pulse.tag_id,
                "time_ns": one.pulse.start_time_ns,
                "longitude_deg": one.pose.longitude_deg,
                "latitude_deg": one.pose.latitude_deg,
            }
            for one in placed[::step]
            if one.pose is not None
        ],
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """Which map is asked for."""

    flight: Path
    tag_id: int
    tag_power_dbm: float
    antenna: AntennaChoice

    @classmethod
    def asked(cls, flight: Path, antenna: AntennaChoice, wanted: object) -> "Silence":
        """Judge a page's question; raises `FormatError` or `UsageError`."""
        if not isinstance(wanted, dict):
            raise FormatError("a question must be an object")
        tag_id, power = wanted.get("tag_id"), wanted.get("tag_power_dbm")
        if type(tag_id) is not int:
            raise FormatError("tag_id must be a whole number")
        if isinstance(power, bool) or not isinstance(power, int | float):
            raise FormatError("tag_power_dbm must be a number")
        low, high = _POWER_DBM
        if not low <= power <= high:
            raise UsageError(f"a tag's power must be {low:g} to {high:g} dBm")
        return cls(flight=flight, tag_id=tag_id, tag_power_dbm=float(power), antenna=antenna)


@dataclass(slots=True, kw_only=True, eq=False)
class _Work:
    """A map that is being made, or is there."""

    asked: Silence
    done: float = 0.0
    found: "SilentMap | None" = None
    fault: str | None = None
    given_up: threading.Event = field(default_factory=threading.Event)


class _GivenUpError(Exception):
    """Another map is wanted."""


class SilenceDesk:
    """Makes maps of where a tag would have been heard, one at a time; keeps the last."""

    def __init__(self) -> None:
        self._work: _Work | None = None

    def answer(self, asked: Silence) -> Record:
        """Tell how far the map is, or what it shows; begin it where it is a new one."""
        work = self._work
        if work is None or work.asked != asked:
            if work is not None:
                work.given_up.set()
            self._work = work = _Work(asked=asked)
            threading.Thread(
                target=_make, args=(work,), name="map of silence", daemon=True
            ).start()
        if work.fault is not None:
            self._work = None
            return {"state": "failed", "error": work.fault}
        if work.found is None:
            return {"state": "working", "done": round(work.done, 3)}
        return {"state": "done", **_record(work.found)}

    def absence(self, asked: Silence, wanted: object) -> Record:
        """Tell how probable it is that a tag that was not heard is not in an outline.

        Raises
        ------
        FormatError
            There is no outline.
        UsageError
            The map is not there yet, the tag was heard, or the outline lies outside.
        """
        work = self._work
        if work is None or work.asked != asked or work.found is None:
            raise UsageError("the map is not there yet", remedy="Ask for it first")
        if work.found.ambiguous:
            raise UsageError(
                f"a train on the frequency of tag {asked.tag_id} may be its own: it cannot be "
                "said to be silent"
            )
        if work.found.heard:
            raise UsageError(
                f"tag {asked.tag_id} was heard: it is not silence that tells of it"
            )
        plane = work.found.coverage.ground.plane
        longitude, latitude = np.array(_outline(wanted)).T
        east, north = plane.to_local(latitude, longitude)
        corners = tuple(zip(east.tolist(), north.tolist(), strict=True))
        area = planning.Polygon(corners=corners, name="area")
        cells = analysis.inside(area, work.found.coverage.ground)
        found = planning.absence(work.found.coverage, cells, None)
        return {**asdict(found), "prior_is": "anywhere on the map alike"}


def _outline(wanted: object) -> list[list[float]]:
    outline = wanted.get("outline") if isinstance(wanted, dict) else None
    good = isinstance(outline, list) and 3 <= len(outline) <= _MOST_CORNERS
    if not good or not all(_is_place(one) for one in outline or ()):
        raise FormatError("an outline is a list of 3 or more [longitude, latitude]")
    assert isinstance(outline, list)
    return outline


def _is_place(one: object) -> bool:
    return (
        isinstance(one, list)
        and len(one) == 2
        and all(isinstance(value, int | float) and abs(value) <= 360.0 for value in one)
    )


def _make(work: _Work) -> None:
    try:
        _map(work)
    except _GivenUpError:
        return
    except UavrtError as error:
        work.fault = str(error)
    except (OSError, MemoryError) as error:
        work.fault = f"the map could not be made: {error}"


def _map(work: _Work) -> None:
    asked = work.asked
    dem = asked.antenna.dem

    def on_pulse(done: int, total: int) -> None:
        work.done = done / max(total, 1)
        if work.given_up.is_set():
            raise _GivenUpError

    work.found = analysis.silent_map(
        asked.flight,
        read_flight(asked.flight),
        asked.tag_id,
        asked.tag_power_dbm,
        elevation=open_elevation(Path(dem)) if dem else None,
        antenna=asked.antenna.pattern,
        on_pulse=on_pulse,
    )


def _record(found: "SilentMap") -> Record:
    coverage, ground = found.coverage, found.coverage.ground
    half = 0.5 * ground.cell_m
    west, east = float(ground.east_m[0]) - half, float(ground.east_m[-1]) + half
    south, north = float(ground.north_m[0]) - half, float(ground.north_m[-1]) + half
    latitude, longitude = ground.plane.to_geodetic(
        [west, east, east, west], [north, north, south, south]
    )
    return {
        "tag_id": found.tag_id,
        "tag_power_dbm": found.tag_power_dbm,
        "corners": np.stack([longitude, latitude], axis=-1).tolist(),
        "picture": base64.b64encode(_picture(coverage.heard)).decode(),
        "mean_probability": _known(coverage.mean),
        "share_above_90": _known(coverage.share_above(0.9)),
        "cell_m": ground.cell_m,
        "heard_pulses": found.heard_pulses,
        "in_hindsight": found.in_hindsight,
        "whole_flight": coverage.whole_flight,
        "noise": found.noise,
        "limitations": list(coverage.limitations),
    }


def _picture(heard: NDArray[np.float32]) -> bytes:
    return png_bytes(chance(heard[::-1]))


def _known(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
