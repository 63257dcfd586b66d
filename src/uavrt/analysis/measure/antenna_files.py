"""Read and write antenna patterns, either measured or learnt from a flight.

The format is CSV with ``#`` comments: angle off boresight [deg], gain [dB], and optionally the
gain across the elements [dB]. Angles may be in any order. Values on both sides of the boresight
are averaged, since a pattern is symmetric.
"""

import math
import os
from pathlib import Path

import numpy as np

from uavrt.core.errors import FormatError, NotFound
from uavrt.formats.csv_line import csv_cells
from uavrt.formats.text import read_lines
from uavrt.formats.whole_file import write_whole
from uavrt.localization.antenna import PATTERNS, AntennaPattern

STEP_DEG = 5.0
_WIDEST_GAP_DEG = 45.0


def antenna_named(text: str) -> str:
    """Return the name of an antenna pattern; if `text` is the path of a pattern file, it is
    read and registered.
    """
    if text in PATTERNS:
        return text
    path = Path(text)
    if not path.is_file():
        raise NotFound(
            f"there is no antenna {text!r}",
            remedy=f"Choose from {', '.join(PATTERNS)}, or name a file of angles and gains",
        )
    pattern = read_antenna(path)
    PATTERNS.add(pattern.name, pattern)
    return pattern.name


def read_antenna(path: str | os.PathLike[str]) -> AntennaPattern:
    """Read an antenna pattern, which is named after its file. Raises `FormatError` for wrong
    lines or angles.
    """
    rows: list[tuple[float, ...]] = []
    for number, line in enumerate(read_lines(Path(path)), start=1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        try:
            row = tuple(float(cell) for cell in csv_cells(text))
            if len(row) not in (2, 3) or not all(map(math.isfinite, row)):
                raise ValueError("the line must have 2 or 3 finite numbers")
        except ValueError as error:
            if not rows and any(character.isalpha() for character in text):
                continue  # a line of names
            raise FormatError(
                f"{os.fspath(path)} line {number} is not an angle with a gain: {error}",
                remedy="Each line holds an angle in degrees and a gain in decibel: 30, -1.5",
            ) from None
        rows.append(row)
    if not rows or len({len(row) for row in rows}) != 1:
        raise FormatError(
            f"{os.fspath(path)} is not a table of angles and gains",
            remedy="Each line holds an angle in degrees and a gain in decibel: 30, -1.5",
        )
    table = np.array(rows)
    planes = [_on_grid(table[:, 0], column, path) for column in table[:, 1:].T]
    return AntennaPattern(
        name=Path(path).name,
        e_plane_db=planes[0],
        h_plane_db=planes[1] if len(planes) > 1 else None,
    )


def _on_grid(
    angle_deg: "np.ndarray[tuple[int], np.dtype[np.float64]]",
    gain_db: "np.ndarray[tuple[int], np.dtype[np.float64]]",
    path: str | os.PathLike[str],
) -> tuple[float, ...]:
    """Interpolate gains [dB], relative to boresight, to angles of 0°, 5° … 180°."""
    folded = np.round(np.abs(np.remainder(angle_deg + 180.0, 360.0) - 180.0), 3)
    angles, which = np.unique(folded, return_inverse=True)
    mean = np.bincount(which, gain_db) / np.bincount(which)
    gaps = np.diff(np.concatenate([[0.0], angles, [180.0]]))
    if gaps.max() > _WIDEST_GAP_DEG:
        raise FormatError(
            f"{os.fspath(path)} lists no gains over a range of {gaps.max():.0f}°",
            remedy="Give gains from 0° to 180° off boresight, at least every 45°",
        )
    grid = np.arange(0.0, 180.0 + STEP_DEG / 2, STEP_DEG)
    gains = np.interp(grid, angles, mean)
    return tuple(float(value) for value in gains - gains[0])


def write_antenna(pattern: AntennaPattern, path: Path, remark: str) -> None:
    """Write an antenna pattern as `read_antenna` reads it. Raises `RecordingError`."""
    lines = [f"# {remark}", "angle_deg,gain_db" + (",across_db" if pattern.h_plane_db else "")]
    grid = np.arange(0.0, 180.0 + STEP_DEG / 2, STEP_DEG)
    columns = [grid, pattern.gain_db(grid)]
    if pattern.h_plane_db is not None:
        steps = np.linspace(0.0, 180.0, len(pattern.h_plane_db))
        columns.append(np.interp(grid, steps, pattern.h_plane_db))
    lines += [",".join(f"{value:.2f}" for value in row) for row in zip(*columns, strict=True)]
    write_whole(path, "\n".join(lines) + "\n")
