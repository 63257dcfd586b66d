"""Measure the noise of a receiver at rest in past flights, as a reference for present noise.

Receivers are not calibrated in watts, and usual levels differ between drones. So the reference
is the noise before take-off, with the motors off. If that is missing, the reference is the
level that a tenth of a flight's noise values are below.
"""

import os
from collections.abc import Iterable, Iterator
from itertools import islice
from math import isfinite, log10
from pathlib import Path
from statistics import median, quantiles

from uavrt.core.errors import FormatError
from uavrt.flight.reading.flight_reader import flight_database

MOST_FLIGHTS = 10
"""Number of recent flights for the median noise; few, as receivers and gains change."""
_IN_THE_AIR_M = 2.0
_LEAST = 3
"""Number of noise values before take-off from which their median is used."""
_NOISE = (
    "SELECT tag_id, time_ns, noise_psd FROM search_reports WHERE noise_psd > 0 UNION ALL"
    " SELECT tag_id, start_time_ns, noise_psd FROM pulses WHERE noise_psd > 0"
)


def read_quiet_noise_db(directory: str | os.PathLike[str]) -> float | None:
    """Median noise before take-off in a flight [dB re units/Hz]; None without a take-off."""
    with flight_database(Path(directory)) as database:
        (taken_off_ns,) = database.execute(
            "SELECT min(time_ns) FROM poses WHERE altitude_relative_m > ?", (_IN_THE_AIR_M,)
        ).fetchone()
        rows = [] if taken_off_ns is None else database.execute(_NOISE).fetchall()
        levels: dict[int, list[tuple[int, float]]] = {}
        for tag_id, time_ns, noise_psd in rows:
            if isfinite(noise_psd):
                levels.setdefault(tag_id, []).append((time_ns, 10.0 * log10(noise_psd)))
        return (
            median(_quiet_db(one, taken_off_ns) for one in levels.values()) if levels else None
        )


def usual_noise_db(levels_db: Iterable[float | None]) -> float | None:
    """Median of the first 10 known noise levels of flights [dB]; None if none is known."""
    known = list(islice((one for one in levels_db if one is not None), MOST_FLIGHTS))
    return median(known) if known else None


def read_usual_noise_db(directories: Iterable[Path]) -> float | None:
    """Read the median noise of past flights [dB], given with the newest first.

    Damaged flights are skipped. The result is None if no flight has a noise level.
    """
    return usual_noise_db(_levels_db(directories))


def _levels_db(directories: Iterable[Path]) -> Iterator[float | None]:
    for one in directories:
        try:
            yield read_quiet_noise_db(one)
        except FormatError:
            continue


def _quiet_db(timed: list[tuple[int, float]], taken_off_ns: int) -> float:
    before = [level_db for time_ns, level_db in timed if time_ns < taken_off_ns]
    if len(before) >= _LEAST:
        return median(before)
    levels = [level_db for _, level_db in timed]
    return quantiles(levels, n=10, method="inclusive")[0] if len(levels) > 1 else levels[0]
