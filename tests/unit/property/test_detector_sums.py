"""The detector's sums, written for speed, against their definitions."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.detection.search.grid import make_grid
from uavrt.detection.search.hypotheses import interval_grid, jitter_reach
from uavrt.detection.search.long_groups import LongSearch
from uavrt.detection.search.noise import _truncated
from uavrt.detection.search.tuning import NOISE
from uavrt.detection.signal.sample_buffer import SampleBuffer

SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=15)
@given(
    seed=SEEDS,
    sample_rate_hz=st.sampled_from([3750.0, 7500.0, 10_000.0]),
    width_s=st.floats(0.012, 0.030),
    window_hz=st.sampled_from([100.0, 500.0, 1e6]),
    offset_hz=st.floats(-1500.0, 1500.0),
)
def test_a_cells_power_is_the_squared_transform_of_its_window(
    seed: int, sample_rate_hz: float, width_s: float, window_hz: float, offset_hz: float
) -> None:
    grid = make_grid(
        sample_rate_hz=sample_rate_hz,
        pulse_width_s=width_s,
        offset_hz=offset_hz,
        half_width_hz=window_hz,
    )
    rng = np.random.default_rng(seed)
    band = rng.standard_normal(600).astype(np.float32).view(np.complex64)
    power = grid.power(band)
    hop = grid.hop // grid.decimation
    n = np.arange(grid.length) * grid.decimation / sample_rate_hz
    turns = np.exp(-2j * np.pi * np.outer(n, grid.offsets_hz - grid.turn_hz))
    scale = grid.decimation / np.sqrt(grid.length * grid.decimation)
    for column in range(len(power)):
        window = band[column * hop : column * hop + grid.length].astype(np.complex128)
        slow = np.abs(scale * window @ turns) ** 2
        assert np.allclose(power[column], slow, rtol=2e-5, atol=2e-5 * slow.mean())


@settings(max_examples=6)
@given(
    seed=SEEDS, k=st.integers(9, 14), cuts=st.lists(st.integers(1, 40), min_size=3, max_size=9)
)
def test_the_search_of_long_groups_is_the_sum_over_all_their_cells(
    seed: int, k: int, cuts: list[int]
) -> None:
    rng = np.random.default_rng(seed)
    hop_s, interval_s, uncertainty_s, jitter_s = 0.0024, 0.05, 0.002, 0.003
    power = rng.exponential(size=(400 + sum(cuts), 4)).astype(np.float32)
    noise = rng.uniform(0.5, 2.0, 4).astype(np.float32)
    search = LongSearch(
        rows=4,
        hop_s=hop_s,
        interval_s=interval_s,
        uncertainty_s=uncertainty_s,
        jitter_s=jitter_s,
        k=k,
        threshold=1e6,
        rate=1,
    )
    reach = jitter_reach(jitter_s, hop_s)
    intervals = interval_grid(
        interval_s=interval_s, uncertainty_s=uncertainty_s, hop_s=hop_s, k=k, reach=reach
    )
    padded = np.pad(power, ((reach, 0), (0, 0)))
    largest = np.array(
        [padded[i : i + 2 * reach + 1].max(axis=0) for i in range(len(power) - reach)]
    )
    cells = np.minimum(largest / noise, 14.0)
    before = np.zeros((len(cells), 4))
    edges = [0, *itertools.accumulate(cuts), len(power)]
    for first, last in itertools.pairwise(edges):
        done = search.columns
        search.best = 0.0
        search.push(power[first:last], noise)
        best = 0.0
        for column, interval in itertools.product(range(done, search.columns), intervals):
            at = [column - int(np.rint(back * interval)) for back in range(k)]
            total = sum(cells[c] if c >= 0 else before[0] for c in at)
            best = max(best, float(np.max(total)))
        assert abs(search.best * 1e6 - best) < 1e-3 * max(best, 1.0)


@given(seed=SEEDS, columns=st.integers(1, 60))
def test_the_truncated_mean_takes_only_cells_below_the_truncation(
    seed: int, columns: int
) -> None:
    rng = np.random.default_rng(seed)
    power = rng.exponential(2.0, size=(columns, 7)).astype(np.float32)
    noise = rng.uniform(0.1, 3.0, 7).astype(np.float32)
    mean, share = _truncated(power, noise)
    kappa = 1.0 - NOISE.excluded_ratio * np.exp(-NOISE.excluded_ratio) / (
        1.0 - np.exp(-NOISE.excluded_ratio)
    )
    for row in range(7):
        kept = power[:, row][power[:, row] < np.float32(NOISE.excluded_ratio) * noise[row]]
        assert abs(share[row] - len(kept) / columns) < 1e-6
        expected = kept.mean() / kappa if len(kept) else noise[row]
        assert abs(mean[row] - expected) < 1e-5 * expected


@given(sizes=st.lists(st.integers(0, 700), min_size=1, max_size=30), late=st.integers(-9, 9))
def test_a_block_is_taken_at_once_where_it_continues_the_last_one_only(
    sizes: list[int], late: int
) -> None:
    def buffer() -> SampleBuffer:
        return SampleBuffer(sample_rate_hz=1000.0, keep=1500, tolerance_s=0.0025)

    quick, slow = buffer(), buffer()
    index = 0
    for size in sizes:
        block = np.arange(index, index + size).astype(np.complex64)
        due_ns = 5_000_000_000 + index * 1_000_000
        off = not slow.empty and abs(late) * 1_000_000 >= 2_500_000
        assert not (off and quick.extend([(block, due_ns + late * 1_000_000)]))
        if not quick.extend([(block, due_ns)]):
            quick.append(block, due_ns)
        slow.append(block, due_ns)
        index += size
        assert (quick.start, quick.end) == (slow.start, slow.end)
        assert np.array_equal(
            quick.view(quick.start, quick.end), slow.view(slow.start, slow.end)
        )
        assert quick.time_ns(index) == slow.time_ns(index)


@settings(max_examples=15)
@given(seed=SEEDS, sample_rate_hz=st.sampled_from([3750.0, 7500.0]))
def test_many_times_have_the_indices_that_each_has(seed: int, sample_rate_hz: float) -> None:
    rng = np.random.default_rng(seed)
    buffer = SampleBuffer(sample_rate_hz=sample_rate_hz, keep=4000, tolerance_s=0.0025)
    begun_ns, given = 1_700_000_000_000_000_000, 0
    for count in rng.integers(1, 300, 8).tolist():
        time_ns = begun_ns + round(given / sample_rate_hz * 1e9 + rng.uniform(-1e5, 1e5))
        buffer.append(np.zeros(count, np.complex64), time_ns)
        given += count
    times_ns = begun_ns + rng.integers(-(10**8), round(given / sample_rate_hz * 1e9), 50)
    each = [buffer.index(time_ns) for time_ns in times_ns.tolist()]
    np.testing.assert_allclose(buffer.indices(times_ns), each, rtol=0.0, atol=1e-6)
    assert len(buffer.indices(times_ns[:0])) == 0
