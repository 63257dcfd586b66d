"""Decimator, channelizer and tuner against their peers, in the receiver's 87 ms blocks."""

from collections.abc import Callable
from functools import partial
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from benchmarks import peers
from benchmarks.harness import Case, Table, compare
from uavrt.core.messages import IQBlock
from uavrt.dsp.channelizer import Channelizer
from uavrt.dsp.decimator import Decimator
from uavrt.dsp.filters import compatible_decimator_taps
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.tuner import tune

Samples = NDArray[np.complex64]
RATE_HZ = 3e6
BAND_HZ = 375e3
BLOCK = 262_144
UPFIRDN_TO_CSDR = 16.6
"""Time of scipy.signal.upfirdn over that of csdr's own function."""


def run() -> list[Table]:
    """All tables of this section."""
    return [decimators(), channelizers(), front_ends(), tuners()]


def noise(count: int, seed: int) -> Samples:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, 2), dtype=np.float32).view(np.complex64)[:, 0].copy()


def over(blocks: list[Samples], work: Callable[[Samples], object]) -> Callable[[], object]:
    """Work on the next of several blocks, so that none is still in the cache from before."""
    turn = cycle(blocks)
    return lambda: work(next(turn))


def decimators() -> Table:
    """3 MS/s by 8."""
    blocks = [noise(BLOCK, seed) for seed in range(4)]
    seconds = BLOCK / RATE_HZ
    taps = compatible_decimator_taps(8).astype(np.float32)

    def case(
        name: str,
        work: Callable[[Samples], object],
        scale: float = 1.0,
        bar: float | None = None,
    ) -> Case:
        return Case(
            name=name, run=over(blocks, work), signal_s=seconds, scale=scale, at_most=bar
        )

    csdr, liquid = peers.csdr_decimator(8, taps), peers.liquid_decimator(8, taps)
    cases, absent = [], []
    notes = ["Baseline: csdr's own `fir_decimate_cc`, called in this process."]
    if csdr is not None:
        cases.append(case("csdr", csdr))
    else:
        from scipy.signal import upfirdn

        cases.append(case("csdr", lambda x: upfirdn(taps, x, down=8), 1 / UPFIRDN_TO_CSDR))
        notes = [
            "csdr is not installed: its row is `scipy.signal.upfirdn` with the same 81 taps "
            f"divided by the recorded ratio of {UPFIRDN_TO_CSDR} to 1."
        ]
    if liquid is not None:
        cases.append(case("liquid-dsp firdecim_crcf, 81 taps", liquid))
    else:
        absent.append(("liquid-dsp firdecim_crcf", "not installed"))
    compatible, default = Decimator(factor=8, mode="compatible"), Decimator(factor=8)
    cases.append(case("ours, compatible (81 taps)", compatible.process, bar=0.9))
    cases.append(case(f"ours, default ({default.taps.size} taps)", default.process, bar=1.0))
    return compare(
        "Decimator, 3 MS/s to 375 kS/s", cases, baseline="csdr", absent=absent, notes=notes
    )


def channelizers() -> Table:
    """375 kS/s to 100 channels."""
    size = BLOCK // 8 // 100 * 100
    blocks = [noise(size, seed) for seed in range(4)]
    seconds = size / BAND_HZ

    def case(name: str, bank: Channelizer, bar: float | None = None) -> Case:
        return Case(name=name, run=over(blocks, bank.process), signal_s=seconds, at_most=bar)

    liquid = peers.liquid_bank(100, 6)
    cases, absent = [], []
    if liquid is not None:
        cases.append(Case(name="liquid-dsp", run=over(blocks, liquid), signal_s=seconds))
    else:
        absent.append(("liquid-dsp", "not installed (libliquid-dev and a C compiler)"))
    cases.append(case("ours, compatible, 100", Channelizer(mode="compatible"), 0.35))
    cases.append(case("ours, default, 100", Channelizer(), 0.7))
    for count in (1, 2, 4, 8, 16, 24, 32, 48):
        chosen = tuple(range(0, 2 * count, 2))
        cases.append(case(f"ours, default, {count} in use", Channelizer(in_use=chosen)))
    return compare(
        "Channelizer, 375 kS/s to 100 channels",
        cases,
        baseline="liquid-dsp",
        absent=absent,
        notes=[
            "liquid-dsp: `firpfbch_crcf` analyzer, 12 taps per channel, 80 dB, critically "
            "sampled, 100 channels, called from a loop in C."
        ],
    )


def front_ends() -> Table:
    """Blocks in, channel blocks out."""
    blocks = [noise(BLOCK, seed) for seed in range(4)]

    def case(count: int) -> Case:
        tags = [150e6 + 2400.0 * (index - count // 2) + 1200.0 for index in range(count)]
        front_end = FrontEnd(
            sample_rate_hz=RATE_HZ, center_frequency_hz=150e6, frequencies_hz=tags
        )
        place = 0

        def step(samples: Samples) -> object:
            nonlocal place
            block = IQBlock(
                samples=samples,
                sample_index=place,
                time_ns=round(place / RATE_HZ * 1e9),
                sample_rate_hz=RATE_HZ,
            )
            place += samples.size
            return front_end.process(block)

        return Case(name=f"{count} tag(s)", run=over(blocks, step), signal_s=BLOCK / RATE_HZ)

    return compare(
        "Front end, 3 MS/s to the tags' channels, default mode",
        [case(count) for count in (1, 10, 50, 100)],
    )


def tuners() -> Table:
    """Once a flight; in seconds of CPU, not per cent."""
    rng = np.random.default_rng(3)
    cases = []
    for count in (1, 10, 100):
        tags = list(150e6 + rng.integers(-105_000, 105_000, count).astype(float))
        cases.append(Case(name=f"{count} tag(s)", run=partial(tune, tags), signal_s=1.0))
    table = compare("Tuner", cases, rounds=9)
    rows = [[row[0], f"{10 * float(row[1]):.1f}"] for row in table.rows]
    return Table(title=table.title, header=["", "CPU ms"], rows=rows)
