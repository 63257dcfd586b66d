"""Compute the spectrograms of several tags at once.

Tags with equal pulse width and window share the transform at 0 Hz; if the rows are not
symmetric around the tag, as at a channel's edge, it has its own.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import OUTPUTS_PER_ROW, Spectrogram, power_by_halves
from uavrt.detection.search.tuning import GRID


class Workspace:
    """Arrays that are reused, because allocating a large array costs a page fault per 4 kB."""

    def __init__(self) -> None:
        self._arrays: dict[str, NDArray[np.float32]] = {}

    def take(self, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Array with arbitrary content, valid until one of the same name is requested again."""
        size = math.prod(shape)
        kept = self._arrays.get(name)
        if kept is None or kept.size < size:
            kept = self._arrays[name] = np.zeros(size, np.float32)
        return kept[:size].reshape(shape)


def columns_ahead(spectrogram: Spectrogram, samples: int) -> int:
    """Number of columns that further channel samples, from index `needed` on, complete."""
    grid = spectrogram.grid
    assert grid.filter is not None
    stride = OUTPUTS_PER_ROW * grid.decimation
    outputs = OUTPUTS_PER_ROW * max(0, (samples - len(grid.filter)) // stride + 1)
    carried = len(spectrogram.band) + outputs - grid.length
    return max(0, carried // (grid.hop // grid.decimation) + 1)


def push_together(
    spectrograms: Sequence[Spectrogram],
    stretches: Sequence[NDArray[np.complex64]],
    workspace: Workspace,
) -> NDArray[np.float32]:
    """Add samples to spectrograms; return the new power (spectrograms, rows, columns)."""
    grid = spectrograms[0].grid
    count = columns_ahead(spectrograms[0], len(stretches[0]))
    used = count * (grid.hop // grid.decimation)
    power = workspace.take("power", (len(stretches), grid.rows, count))
    if grid.for_kernel:
        for index, (spectrogram, stretch) in enumerate(
            zip(spectrograms, stretches, strict=True)
        ):
            block = spectrogram.lengthened(stretch)
            spectrogram.band = block[used:].copy()
            grid.power_by_kernel(block, power, index * grid.rows * count, count)
        return power
    for begin in range(0, len(stretches), GRID.tags_at_once):
        some = slice(begin, begin + GRID.tags_at_once)
        blocks = []
        for spectrogram, stretch in zip(spectrograms[some], stretches[some], strict=True):
            block = np.concatenate((spectrogram.band, spectrogram.decimate(stretch)))
            spectrogram.band = block[used:].copy()
            blocks.append(block)
        shape = (2, len(blocks), len(blocks[0]))
        parts = workspace.take("parts", shape)
        for index, block in enumerate(blocks):
            parts[0, index], parts[1, index] = block.real, block.imag
        power_by_halves(grid, parts, power[some], 0, workspace.take)
    return power
