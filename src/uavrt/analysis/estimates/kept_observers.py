"""Learn the errors of bearings taken by hand from test trials, and store them by observer."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from uavrt.core.clock import iso_utc
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.foreign import read_record
from uavrt.formats.bearings_csv import BearingRow
from uavrt.formats.whole_file import write_whole
from uavrt.localization.position.bearings.lenth import Rays
from uavrt.localization.position.bearings.observers import Observer, learn_observer


def observers_of(
    tables: Sequence[tuple[Path, Sequence[BearingRow]]],
    kept: Path | None,
    warn: Callable[[str], None],
) -> dict[str, Observer]:
    """Bearing errors of each observer: stored ones, and those of trials in `tables`.

    `kept` is the file to read and update; None reads an observers.json next to a table. Raises
    `FormatError` for a damaged file, `UsageError` if there is neither a file nor a trial, and
    `RecordingError` if the file cannot be written.
    """
    files = [path.with_name("observers.json") for path, _ in tables] if kept is None else [kept]
    known = {one.name: one for path in files if path.exists() for one in _read(path)}
    trials = defaultdict[tuple[str, tuple[float, float], int, str], list[BearingRow]](list)
    for row in (row for _, rows in tables for row in rows):
        if row.observer and row.true_place:
            day = iso_utc(row.start_time_ns or 0)[:10]
            trials[row.observer, row.true_place, row.tag_id, day].append(row)
    if kept is not None and not trials and not kept.exists():
        raise UsageError(
            f"{kept} does not exist, and no table contains an observer's test trials",
            remedy="Name a table with the columns observer, true_latitude_deg and "
            "true_longitude_deg",
        )
    for name in sorted({key[0] for key in trials}):
        own = [_rays(key[1], rows) for key, rows in trials.items() if key[0] == name]
        known[name] = learn_observer(name, own)
        warn(known[name].sentence)
    if kept is not None and trials:
        write_whole(kept, msgspec.json.format(msgspec.json.encode([*known.values()])))
        warn(f"these errors are stored in {kept}")
    return known


def _read(path: Path) -> list[Observer]:
    try:
        return read_record(path, list[Observer])
    except FormatError as error:
        raise FormatError(
            f"cannot read {path}: {error}",
            remedy="Delete it, then name the table of test trials again",
        ) from error


def _rays(tag: tuple[float, float], rows: Sequence[BearingRow]) -> Rays:
    plane = TangentPlane(latitude_deg=tag[0], longitude_deg=tag[1])
    table = np.array([(one.latitude_deg, one.longitude_deg, one.bearing_deg) for one in rows])
    east, north = plane.to_local(table[:, 0], table[:, 1])
    return Rays(east_m=east, north_m=north, bearing_deg=table[:, 2])
