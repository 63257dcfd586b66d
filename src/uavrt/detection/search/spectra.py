"""Spectrograms of several tags at once.

Tags with equal pulse width and search window share the transform, since their narrow bands are
shifted to put each tag at zero. Each window is then split into sums and differences of samples
that mirror each other around its middle. Two real matrix products give the rows at + f and - f
together, with a quarter of the multiplications of one complex product. The complex product
remains where rows are not symmetric: at a channel's edge, or for the whole channel.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.search.grid import OUTPUTS_PER_ROW, Grid, Spectrogram
from uavrt.detection.search.tuning import GRID


class Workspace:
    """Reusable arrays: new ones of this size cost a page fault per 4 kB."""

    def __init__(self) -> None:
        self._arrays: dict[str, NDArray[np.float32]] = {}

    def take(self, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Array of arbitrary content, valid until the same name is requested again."""
        size = math.prod(shape)
        kept = self._arrays.get(name)
        if kept is None or kept.size < size:
            kept = self._arrays[name] = np.zeros(size, np.float32)
        return kept[:size].reshape(shape)


def columns_ahead(spectrogram: Spectrogram, samples: int) -> int:
    """Number of columns completed by this number of channel samples from `needed` on."""
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
    """Add channel samples to several spectrograms, each from index `needed` on.

    `spectrograms`: with the same `halves` and the same number of unused samples. `stretches`:
    of equal length, for at least one column. Returns the new columns' power (spectrograms,
    rows, columns), in the workspace.
    """
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
        _power(grid, parts, power[some], workspace)
    return power


def _power(
    grid: Grid, parts: NDArray[np.float32], power: NDArray[np.float32], workspace: Workspace
) -> None:
    """Power of every cell, as `Grid.power`, into shape (tags, rows, columns)."""
    assert grid.halves is not None
    cosines, sines = grid.halves
    hop, half, length = grid.hop // grid.decimation, grid.length // 2, grid.length
    tags, total = parts.shape[1:]
    columns, middle = power.shape[2], grid.rows // 2
    frames = np.ndarray(
        (2, tags, length, columns),
        np.float32,
        parts,
        0,
        (4 * total * tags, 4 * total, 4, 4 * hop),
    )
    late, early = frames[:, :, length - half :], frames[:, :, half - 1 :: -1]
    even = workspace.take("even", (2, tags, length - half, columns))
    odd = workspace.take("odd", (2, tags, half, columns))
    np.add(late, early, out=even[:, :, :half])
    even[:, :, half:] = frames[:, :, half : length - half]
    np.subtract(late, early, out=odd)
    shape = (2, tags, middle + 1, columns)
    a = np.matmul(cosines, even, out=workspace.take("a", shape))
    b = np.matmul(sines, odd, out=workspace.take("b", shape))
    one = workspace.take("one", shape[1:])
    two = workspace.take("two", shape[1:])
    for out, join, part in (
        (power[:, middle::-1], np.subtract, np.add),
        (power[:, middle:], np.add, np.subtract),
    ):
        join(a[0], b[1], out=one)
        part(a[1], b[0], out=two)
        np.multiply(one, one, out=one)
        np.multiply(two, two, out=two)
        np.add(one, two, out=out)
