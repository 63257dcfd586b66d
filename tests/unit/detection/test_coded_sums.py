"""Sums of coded bursts in kernels and in NumPy, and what waits and what is left out of them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from depth import share
from numpy.typing import NDArray

from uavrt.core.runtime import native
from uavrt.detection.coded.code_folds import Waiting
from uavrt.detection.coded.code_judging import Burst, Overlaps, may_suffice, weigh
from uavrt.detection.coded.slot_cells import Cells
from uavrt.detection.coded.sums import FIELDS, CodeBook, find_seeds, fold, make_code_book
from uavrt_experiments.detection.coded import some_codes

COLUMN_S = 2.7e-4
GAPS = {3: (0.021, 0.030), 4: (0.021, 0.030, 0.026), 6: (0.021, 0.030, 0.026, 0.019, 0.024)}


def _cells() -> Cells:
    """Noise of 9 s, as cells keep it; a byte may also be the largest that there is."""
    made = Cells(
        sample_rate_hz=7500.0,
        pulse_width_s=0.0025,
        low_hz=-300.0,
        high_hz=300.0,
        kept_s=8.0,
        recent_s=1.0,
    )
    rng = np.random.default_rng(5)
    noise = np.repeat(rng.exponential(4.0, (len(made.kept), made.kept.shape[1] // 3 + 1)), 3, 1)
    made.kept[:] = np.minimum(noise[:, : made.kept.shape[1]], 63)
    made.base, made.end = 1000, 1000 + made.kept.shape[1]
    return made


def _book(pulses: int) -> CodeBook:
    one = some_codes(np.random.default_rng(2), 1)[0]
    tags = (
        replace(one, tag_id=number + 1, gaps_s=tuple(gap + 0.003 * number for gap in gaps))
        for number, gaps in enumerate([GAPS[pulses]] * 3)
    )
    return make_code_book(
        tuple(replace(tag, pulse_intervals_s=(0.8,)) for tag in tags), COLUMN_S
    )


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize("pulses", [3, 4, 6])
@pytest.mark.parametrize("clip", [40, 63])
def test_kernels_find_the_seeds_that_numpy_finds(pulses: int, clip: int) -> None:
    cells, book = _cells(), _book(pulses)
    clip = min(clip, 255 // pulses)
    latest = cells.end - book.span - 4
    found = 0
    for first, count in ((1000, 700), (1003, 61), (1950, 64), (2000, 129), (latest - 300, 300)):
        own = find_seeds(cells, book, first, count, clip=clip, level=10 * pulses)
        with native.numpy_only():
            other = find_seeds(cells, book, first, count, clip=clip, level=10 * pulses)
        assert np.array_equal(own, other)
        found += len(own)
    assert found > 20


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize("pulses", [3, 4, 6])
@pytest.mark.parametrize(("bursts", "reach"), [(3, 15.0), (10, 15.0), (10, 0.0), (7, 37.5)])
def test_kernels_sum_several_bursts_as_numpy_does(
    pulses: int, bursts: int, reach: float
) -> None:
    cells, book = _cells(), _book(pulses)
    clip = min(40, 255 // pulses)
    width = cells.end - cells.base - book.span - 4
    seeds = find_seeds(cells, book, cells.base, width, clip=clip, level=11 * pulses)[::7]
    steps = int(np.ceil((bursts - 1) * reach / 2.0))
    options: dict[str, Any] = {"bursts": bursts, "reach": reach, "steps": steps, "clip": clip}
    own = fold(cells, book, seeds, **options)
    with native.numpy_only():
        other = fold(cells, book, seeds, **options)
    assert len(own) > 20
    assert np.array_equal(own, other)


@pytest.mark.skipif(native.kernels() is None, reason=native.description())
def test_a_kernel_refuses_intervals_further_apart_than_it_sums() -> None:
    cells, book = _cells(), _book(4)
    seeds = np.array([[0, 0, 0, 20_000, 50]], np.int32)
    with pytest.raises(ValueError, match="too far apart"):
        fold(cells, book, seeds, bursts=10, reach=30.0, steps=40, clip=40)


def test_seeds_wait_for_their_last_burst_and_come_out_in_the_order_they_came() -> None:
    rng = np.random.default_rng(3)
    waiting = Waiting()
    came = np.zeros((0, FIELDS), np.int32)
    ends: NDArray[np.float64] = np.zeros(0)
    for step in range(40):
        new = rng.integers(0, 5, (rng.integers(0, 30), FIELDS)).astype(np.int32)
        new[:, 3] = step * 1500 + rng.permutation(1500)[: len(new)]
        new = new[np.lexsort((new[:, 3], new[:, 1], new[:, 0]))]
        own = new[:, 3] + rng.choice([900.0, 4096.0, 20_000.5], len(new))
        came, ends = np.concatenate((came, new)), np.concatenate((ends, own))
        waiting.add(new, own)
        whole = (step + 1) * 1500
        assert np.array_equal(waiting.due(whole), came[ends < whole])
        came, ends = came[ends >= whole], ends[ends >= whole]
    assert len(came) > 20
    assert np.array_equal(waiting.due(np.inf), came)
    assert not len(waiting.due(np.inf))


def _burst(
    book: CodeBook,
    code: int,
    column: int,
    energies: NDArray[np.float64],
    good: NDArray[np.bool_],
) -> Burst:
    offsets = book.offsets[code, 0]
    return Burst(
        book=book,
        code=code,
        row=0,
        stretch=0,
        column=column,
        offsets=offsets,
        columns=(column + offsets).astype(np.intp),
        energies=energies,
        good=good,
    )


def _bursts(energies: NDArray[np.float32], good: NDArray[np.bool_]) -> list[Burst]:
    book = _book(4)
    return [
        _burst(book, 0, 0, own.astype(np.float64), heard.copy())
        for own, heard in zip(energies, good, strict=True)
    ]


@pytest.mark.parametrize("foreign_per_hour", share([7000.0, 0.1], 2))
def test_nothing_that_would_be_weighed_is_left_out_before(foreign_per_hour: float) -> None:
    rng = np.random.default_rng(4)
    limits = {3: 34.0, 4: 38.0}
    any_ = rng.gamma(1.0, rng.choice([1.0, 6.0, 14.0, 60.0], (4000, 4)))
    any_[:800] = rng.uniform(8.0, 13.0, (800, 1))  # about the limit, all equal
    energies = any_.astype(np.float32)
    able = may_suffice(energies, limits)
    one_is_hit = np.arange(4) != rng.integers(0, 4, (4000, 1))
    for good in (one_is_hit, np.ones((4000, 4), np.bool_)):
        bursts = _bursts(energies, good)
        taken = weigh(bursts, limits, foreign_per_hour)
        assert len(taken) > 100
        places = {id(one): place for place, one in enumerate(bursts)}
        assert able[[places[id(one)] for one in taken]].all()
        alone = [len(weigh([one], limits, foreign_per_hour)) for one in _bursts(energies, good)]
        assert sum(alone) == len(taken)
    assert able.sum() < 2000


def test_pulses_that_lie_on_those_on_air_are_covered_and_the_rest_is_alone() -> None:
    rng = np.random.default_rng(6)
    books = {pulses: _book(pulses) for pulses in (3, 4)}
    bursts = []
    for number in range(40):
        pulses, column = 3 + number % 2, int(rng.integers(0, 600))
        energies, good = rng.uniform(5.0, 30.0, pulses), rng.random(pulses) < 0.8
        bursts.append(_burst(books[pulses], number % 3, column, energies, good))
    claims, on_air = bursts[:30], bursts[30:]
    covered = Overlaps(claims, guard=9)
    covered.add(*on_air[:4])
    for burst in on_air[4:]:
        covered.add(burst)
    for i, claim in enumerate(claims):
        hits = [
            [bool((abs(other.columns - column) <= 9).any()) for column in claim.columns]
            for other in on_air
        ]
        lies = np.any(hits, axis=0)
        assert np.array_equal(covered.pulses[i, : len(lies)], lies)
        assert covered.count[i] == lies.sum()
        assert covered.alone[i] == (claim.good & ~lies).sum()
        assert covered.overlapped_by(i) == [
            o for o, hit in zip(on_air, hits, strict=True) if any(hit)
        ]
        length = claim.columns[-1] - claim.columns[0]
        assert covered.is_sending(claim) == any(
            one.tag_id == claim.tag_id and abs(one.column - claim.column) <= length
            for one in on_air
        )
    assert 0 < sum(covered.too_few_left(i) for i in range(30)) < 30
