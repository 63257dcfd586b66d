"""A closer look at several bursts: the samples again, between the cells."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.messages import Tag
from uavrt.detection.coded.limits import rayleigh_limit
from uavrt.detection.coded.refinement import refine
from uavrt.detection.coded.slot_cells import Cells
from uavrt_experiments.detection.coded import RATE_HZ, WINDOW_HZ, add_burst, some_codes
from uavrt_experiments.detection.signals import noise

RNG = np.random.default_rng(8)
TAG: Tag = replace(some_codes(RNG, 1)[0], pulse_intervals_s=(1.0,))
BURSTS, START_S, ROW, ENR_DB = 8, 2.0001, 4, 23.0


@pytest.fixture(scope="module")
def cells() -> Cells:
    """Eight bursts that begin between columns, half-way between two rows."""
    made = Cells(
        sample_rate_hz=RATE_HZ,
        pulse_width_s=TAG.pulse_width_s,
        low_hz=-WINDOW_HZ,
        high_hz=WINDOW_HZ,
        kept_s=20.0,
        recent_s=12.0,
    )
    samples = noise(RNG, round(12.0 * RATE_HZ))
    for number in range(BURSTS):
        add_burst(
            *(samples, TAG),
            start_s=START_S + number * TAG.pulse_intervals_s[0],
            offset_hz=float(made.offsets_hz[ROW]) + 50.0,
            enr_db=ENR_DB,
            stretch=0.0,
            rng=RNG,
        )
    step = round(0.5 * RATE_HZ)
    for end in range(step, len(samples) + 1, step):
        made.push(samples[made.end * made.hop : end])
    return made


def begins_of(cells: Cells) -> NDArray[np.float64]:
    begins: NDArray[np.float64] = np.rint((START_S + np.arange(BURSTS)) / cells.column_s)
    return begins


def test_a_look_finds_pulses_between_the_cells(cells: Cells) -> None:
    begins = begins_of(cells)
    found = refine(cells, TAG, row=ROW, part=0.0, begins=begins, most=1e9)
    true = (START_S + np.arange(BURSTS)) / cells.column_s
    assert np.abs(found.begins - true).max() < 0.5
    starts = np.concatenate(((0.0,), np.cumsum(TAG.gaps_s))) / cells.column_s
    at = np.rint(begins[:, None] + starts).astype(int) - cells.recent_from
    searched = float(cells.recent[ROW, at].mean())
    told = float(found.energies.mean())
    assert 10.0 * np.log10(told) == pytest.approx(ENR_DB, abs=0.2)
    assert told > 1.02 * searched


def test_what_is_hidden_is_noise_and_what_was_not_heard_is_nothing(cells: Cells) -> None:
    begins = begins_of(cells)
    kept = cells.kept.copy()
    cells.hide(int(begins[2]) - 9, 18)
    found = refine(cells, TAG, row=ROW, part=0.0, begins=begins, most=1e9)
    cells.kept[:] = kept
    assert found.energies[2, 0] == pytest.approx(0.25 * np.pi)  # its amplitude is noise's
    assert found.energies[2, 1:].min() > 50.0
    early = refine(cells, TAG, row=ROW, part=0.0, begins=begins - begins[1], most=1e9)
    assert not early.energies[0].any()
    assert early.energies[1:].mean() > 0.5


@pytest.mark.parametrize(("count", "chance"), [(12, 1e-3), (40, 1e-4)])
def test_sums_of_amplitudes_of_noise_reach_the_limit_as_often_as_said(
    count: int, chance: float
) -> None:
    sums = np.zeros(400_000)
    for _ in range(count):
        sums += np.sqrt(RNG.exponential(size=len(sums)))
    reached = int((sums >= rayleigh_limit(count, chance)).sum())
    assert reached == pytest.approx(chance * len(sums), abs=4.0 * (chance * len(sums)) ** 0.5)
