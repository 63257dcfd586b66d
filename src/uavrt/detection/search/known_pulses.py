"""Recognise candidates of the search that pulses of known tracks and groups explain."""

import math

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import Grid
from uavrt.detection.search.refine import Measured
from uavrt.detection.search.tuning import GROUPS


class KnownPulses:
    """Pulses of confirmed tracks and new groups, to recognise candidates that they explain."""

    def __init__(self, grid: Grid, pulses: list[Measured]) -> None:
        self._grid = grid
        self._pulses = pulses

    def explain(
        self,
        columns: NDArray[np.float64],
        rows: NDArray[np.intp],
        strength: NDArray[np.floating],
        *,
        reach: int,
    ) -> NDArray[np.bool_]:
        """(n,) True for candidates with a pulse that is a known pulse or leakage of one."""
        grid = self._grid
        bin_hz = grid.sample_rate_hz / grid.window
        near = (reach + 1) * grid.hop + 0.75 * grid.window
        starts = columns * grid.hop - (grid.decimation - 1) / 2.0
        # Of a tag received for long, few pulses are near the candidates in time.
        low, high = float(starts.min()) - near, float(starts.max()) + near
        meeting = [
            (m.start, m.offset_hz, m.power) for m in self._pulses if low < m.start < high
        ]
        if not meeting:
            return np.zeros(len(rows), np.bool_)
        at, offset_hz, power = np.array(meeting).T
        after = starts[:, :, np.newaxis] - at
        meet = np.abs(after) < near
        away_hz = offset_hz - grid.offsets_hz[rows][:, np.newaxis, np.newaxis]
        if grid.slide_hz:
            away_hz = away_hz + grid.slide_hz / grid.window * after
        away_hz -= grid.sample_rate_hz * np.rint(away_hz / grid.sample_rate_hz)
        apart = np.abs(away_hz) / bin_hz
        leak = power / np.maximum(1.0, math.pi * apart / 2.0) ** 2
        meet &= (apart < GROUPS.same_bins) | (
            leak > GROUPS.leak_share * strength[:, np.newaxis, np.newaxis]
        )
        return np.asarray(meet.any(axis=(1, 2)))
