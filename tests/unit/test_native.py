"""The compiled kernels do what the NumPy code beside them does, and look at sizes first."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.runtime import native
from uavrt.dsp.channelizer import Channelizer
from uavrt.dsp.decimator import Decimator

ROOT = Path(__file__).parents[2]
built = pytest.mark.skipif(
    native.kernels() is None, reason=f"{native.description()}: python hatch_build.py kernels"
)
Samples = NDArray[np.complex64]


def noise(count: int, seed: int = 1) -> Samples:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, 2), np.float32).view(np.complex64)[:, 0]


def both_ways(
    make: Callable[[], Channelizer | Decimator], samples: Samples, cuts: int
) -> tuple[Samples, Samples]:
    """A stream, cut somewhere, worked through by the kernels and by NumPy."""
    rng = np.random.default_rng(cuts)
    places = np.sort(rng.integers(0, len(samples), cuts))
    by_kernels, by_numpy = make(), make()
    one = [by_kernels.process(part) for part in np.split(samples, places)]
    with native.numpy_only():
        two = [by_numpy.process(part) for part in np.split(samples, places)]
    return np.concatenate(one, axis=-1), np.concatenate(two, axis=-1)


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize("channels", [2, 6, 36, 100, 110, 154, 800])
@pytest.mark.parametrize("mode", ["default", "compatible"])
def test_the_bank_is_the_same(channels: int, mode: str) -> None:
    in_use = sorted({0, 1, channels // 2, channels - 1, *range(0, channels, 3)})

    def make() -> Channelizer:
        return Channelizer(channels=channels, mode=mode, in_use=in_use)  # type: ignore[arg-type]

    one, two = both_ways(make, noise(channels * 70 + 13), 9)
    assert one.shape == two.shape
    assert one.shape[1] > 60
    assert np.abs(one - two).max() < 2e-6 * np.abs(two).max()


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize("factor", [2, 7, 8, 64])
def test_the_decimator_is_the_same(factor: int) -> None:
    one, two = both_ways(lambda: Decimator(factor=factor), noise(4000 * factor + 5), 11)
    assert one.shape == two.shape
    assert np.abs(one - two).max() < 2e-6 * np.abs(two).max()


@built
def test_a_kernel_refuses_what_is_too_short() -> None:
    kernels = native.kernels()
    taps = np.ones(20, np.float32)
    with pytest.raises(ValueError, match="samples"):
        kernels.decimate(noise(27), taps, 2, np.empty(10, np.complex64))
    kernels.decimate(noise(28), taps, 2, np.empty(10, np.complex64))
    with pytest.raises(ValueError, match="taps"):
        kernels.decimate(noise(28), taps.astype(np.float64), 2, np.empty(10, np.complex64))
    with pytest.raises(ValueError, match="factor"):
        kernels.decimate(noise(28), taps, -2, np.empty(10, np.complex64))
    with pytest.raises((ValueError, BufferError)):
        kernels.decimate(noise(56)[::2], taps, 2, np.empty(10, np.complex64))
    read_only = np.empty(10, np.complex64)
    read_only.flags.writeable = False
    with pytest.raises((ValueError, BufferError)):
        kernels.decimate(noise(28), taps, 2, read_only)
    with pytest.raises(TypeError):
        kernels.decimate(noise(28), taps, 2)


@built
def test_the_bank_refuses_channels_that_it_has_not() -> None:
    kernels = native.kernels()
    weights, turns = np.ones((8, 200), np.float32), np.ones(100, np.complex64)
    out, work = np.empty((1, 2), np.complex64), np.empty(9600, np.float32)

    def bank(chosen: int, rows: int = 2, first: int = 0, given: int = 850) -> None:
        kernels.bank(
            *(noise(given), weights, turns, np.array([chosen], np.int32), 100, 50),
            *(0, rows, out, first, work),
        )

    bank(99)
    for wrong in ({"chosen": 100}, {"chosen": -1}, {"chosen": 0, "first": 1}):
        with pytest.raises(ValueError):
            bank(**wrong)
    with pytest.raises(ValueError, match="samples"):
        bank(0, given=849)
    with pytest.raises(ValueError):
        bank(0, rows=-1)


@built
def test_the_search_refuses_rings_and_tables_that_do_not_fit() -> None:
    kernels = native.kernels()
    memory, levels = np.zeros(2 * 150, np.float32), np.ones(2, np.float32)
    power = np.full((2, 10), 9.0, np.float32)

    def note(**other: int) -> None:
        ring = {"base": 0, "rows": 2, "width": 150, "length": 100, "pushed": 95, "at": 90}
        ring |= {"fresh": 5, "first": 0, "reach": 3} | other
        kernels.note(memory, *ring.values(), 3.0, levels, power)

    note()
    for wrong in (
        {"base": 1},
        {"rows": 3},
        {"width": 106},
        {"pushed": 100},
        {"at": -1},
        {"fresh": 90},
        {"reach": 60},
    ):
        with pytest.raises(ValueError):
            note(**wrong)
    lows, rest = np.full((3, 2), -5), np.zeros((3, 2, 4), np.intp)

    def rate(row: int = 0, place: int = 2, stretch: int = 20, most: int = 13) -> object:
        rest[2, 1, 3] = most
        return kernels.rate(
            *(memory, 0, 2, 150, 100, stretch, 3, 14.0, lows, rest, levels),
            *([1000], [row], [9.0], [place], 5.0),
        )

    rate()
    for wrong in ({"row": 2}, {"row": -1}, {"place": 3}, {"most": 14}, {"stretch": 51}):
        with pytest.raises(ValueError):
            rate(**wrong)


@built
def test_the_narrow_band_refuses_what_is_too_short() -> None:
    kernels = native.kernels()
    taps, turns = np.zeros((2, 16), np.float32), np.ones(8, np.complex64)
    out, rows = np.empty(16, np.complex64), np.ones(2, np.complex64)
    kernels.narrow(noise(96), taps, 6, 6, rows, turns, out, 0)
    with pytest.raises(ValueError, match="samples"):
        kernels.narrow(noise(95), taps, 6, 6, rows, turns, out, 0)
    with pytest.raises(ValueError, match="outputs"):
        kernels.narrow(noise(96), taps, 6, 6, rows[:1], turns, out, 0)
    with pytest.raises(ValueError, match="taps"):
        kernels.narrow(noise(96), taps, 9, 6, rows, turns, out, 0)
    cosines, sines = np.ones((3, 4), np.float32), np.ones((3, 4), np.float32)
    power, work = np.empty(50, np.float32), np.empty(500, np.float32)
    kernels.powers(noise(35), 3, 8, cosines, sines, power, 0, 10, work)
    with pytest.raises(ValueError, match="power"):
        kernels.powers(noise(35), 3, 8, cosines, sines, power, 1, 10, work)
    with pytest.raises(ValueError, match="samples"):
        kernels.powers(noise(34), 3, 8, cosines, sines, power, 0, 10, work)
    with pytest.raises(ValueError, match="work"):
        kernels.powers(noise(35), 3, 8, cosines, sines, power, 0, 10, work[:200])
