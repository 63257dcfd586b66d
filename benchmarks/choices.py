"""What each choice of the search is worth in decibel: ``python -m benchmarks.choices``.

The same stretches (thesis's tag, K = 3, ± 500 Hz, noise of known power) are searched in each of
the ways below. Thresholds come from stretches of noise, so that 1 % pass; the gain is the
difference of the pulse energy at which half of the groups are found, with a 95 % interval by
drawing the stretches anew (bootstrap). Nothing of `uavrt.detection` is used: the statistic is
written out here. What following a tag is worth is measured
on the product itself (`--following 10`).
"""

import argparse
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from uavrt.detection.modes import OperatingMode
from uavrt_experiments.detection.signals import THESIS_TAG, noise
from uavrt_experiments.detection.trials import RATE_HZ, Decision, Flight, compare, detect
from uavrt_experiments.statistics import level_for

BAND_HZ = 500.0
ENRS_DB = (7.5, 8.5, 9.5, 10.5)
FALSE_ALARMS = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """One way to search."""

    hops_per_pulse: int = 8
    rows_per_bin: int = 4
    limit: float = 14.0
    """What one cell counts at most, in noise powers."""
    hann: bool = False
    band_hz: float = BAND_HZ


OURS = Search()
WAYS: dict[str, Search] = {
    "ours": OURS,
    "hops of half a pulse": replace(OURS, hops_per_pulse=2),
    "rows half a bin apart": replace(OURS, rows_per_bin=2),
    "both, as the original": replace(OURS, hops_per_pulse=2, rows_per_bin=2),
    "no limit for a cell": replace(OURS, limit=np.inf),
    "limit of 11": replace(OURS, limit=11.0),
    "Hann window": replace(OURS, hann=True),
    "locked to ± 100 Hz": replace(OURS, band_hz=100.0),
}


def power(samples: NDArray[np.complex64], way: Search, center_hz: float) -> NDArray[np.float32]:
    """Cells of a spectrogram, shape (rows, columns), in units of the noise."""
    length = round(THESIS_TAG.pulse_width_s * RATE_HZ)
    step_hz = 1.0 / (way.rows_per_bin * THESIS_TAG.pulse_width_s)
    count = round(way.band_hz / step_hz)
    rows_hz = center_hz + step_hz * np.arange(-count, count + 1)
    window = np.hanning(length + 2)[1:-1] if way.hann else np.ones(length)
    window = window / np.sqrt(np.sum(window**2))
    turn = np.exp(-2j * np.pi * np.outer(rows_hz, np.arange(length)) / RATE_HZ) * window
    frames = np.lib.stride_tricks.sliding_window_view(samples, length)
    frames = frames[:: round(length / way.hops_per_pulse)]
    cells = turn.astype(np.complex64) @ np.ascontiguousarray(frames.T)
    result: NDArray[np.float32] = (cells.real**2 + cells.imag**2).astype(np.float32)
    return np.minimum(result, np.float32(way.limit))


def best(samples: NDArray[np.complex64], way: Search, center_hz: float = 0.0) -> float:
    """The largest sum of three cells a possible interval apart, each within its jitter."""
    tag = THESIS_TAG
    cells = power(samples, way, center_hz)
    hop_s = round(tag.pulse_width_s * RATE_HZ / way.hops_per_pulse) / RATE_HZ
    reach = int(np.ceil(tag.interval_jitter_s / hop_s))
    near = maximum_filter1d(cells, 2 * reach + 1, axis=1)
    middle = round(tag.pulse_intervals_s[0] / hop_s)
    spread = int(np.ceil(tag.interval_uncertainty_s / hop_s))
    found = 0.0
    for step in range(middle - spread, middle + spread + 1):
        columns = cells.shape[1] - 2 * step
        if columns > 0:
            total = cells[:, :columns] + near[:, step : step + columns]
            total += near[:, 2 * step : 2 * step + columns]
            found = max(found, float(total.max()))
    return found


def scores(seeds: range) -> dict[str, NDArray[np.float64]]:
    """Scores by way, shape (1 + ENRs, seeds): of noise alone first."""
    found = {name: np.zeros((1 + len(ENRS_DB), len(seeds))) for name in WAYS}
    case = Decision(band_hz=400.0)
    for place, seed in enumerate(seeds):
        for row, enr_db in enumerate((None, *ENRS_DB)):
            rng = np.random.default_rng([seed, row])
            samples, truth = case.stretch(rng, -60.0 if enr_db is None else enr_db)
            if enr_db is None:
                samples = noise(rng, len(samples))
            for name, way in WAYS.items():
                locked = way.band_hz < BAND_HZ and enr_db is not None
                at_hz = truth[0].offset_hz + rng.uniform(-50.0, 50.0) if locked else 0.0
                found[name][row, place] = best(samples, way, at_hz)
    return found


def half_found_db(found: NDArray[np.float64]) -> float:
    """ENR at which half of the groups pass the threshold."""
    # Gumbel's distribution by its moments, as maxima of noise have it: the tail itself holds
    # 1 % of the stretches only.
    scale = float(found[0].std()) * np.sqrt(6.0) / np.pi
    threshold = (
        found[0].mean() - np.euler_gamma * scale - scale * np.log(-np.log1p(-FALSE_ALARMS))
    )
    points = [
        (enr_db, int((row > threshold).sum()), row.size)
        for enr_db, row in zip(ENRS_DB, found[1:], strict=True)
    ]
    return level_for(points, 0.5)[0]


def following(flights: int) -> None:
    """Print how many pulses are reported of a tag that is followed, and of one that is not.

    The same flights of 150 s, whole channel, pf 1 %, by the product's own detector.
    """
    modes = (OperatingMode.SEARCH_SOFT_LOCK, OperatingMode.ALL_NEVER_LOCK)
    points: dict[OperatingMode, list[tuple[float, int, int]]] = {mode: [] for mode in modes}
    for enr_db in (6.0, 7.0, 8.0, 9.0, 10.0):
        heard, true = dict.fromkeys(modes, 0), 0
        for seed in range(flights):
            rng = np.random.default_rng((round(10.0 * enr_db), seed))
            samples, truth = Flight(enr_db=enr_db, duration_s=150.0).samples(rng)
            true += len(truth)
            for mode in modes:
                pulses, _ = detect(samples, THESIS_TAG, operating_mode=mode)
                heard[mode] += compare(pulses, truth, THESIS_TAG).matched
        for mode in modes:
            points[mode].append((enr_db, heard[mode], true))
            print(f"{enr_db:4.1f} dB {mode.value:20s} {heard[mode]} of {true}")
    for mode in modes:
        print(
            f"{mode.value:20s} half of the pulses at {level_for(points[mode], 0.5)[0]:.2f} dB"
        )


def main() -> None:
    """Search, or read what earlier runs saved, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.choices", description=__doc__)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--count", type=int, default=600, help="stretches of each strength")
    parser.add_argument("--save", help="write the scores to this .npz file, print nothing")
    parser.add_argument("--read", nargs="*", help="add up what --save wrote")
    parser.add_argument("--following", type=int, help="flights of each strength, and no more")
    chosen = parser.parse_args()
    if chosen.following:
        following(chosen.following)
        return
    if chosen.read:
        parts = [np.load(name) for name in chosen.read]
        found = {name: np.concatenate([part[name] for part in parts], axis=1) for name in WAYS}
    else:
        found = scores(range(chosen.first, chosen.first + chosen.count))
    if chosen.save:
        np.savez(chosen.save, allow_pickle=False, **found)
        return
    rng = np.random.default_rng(1)
    count = found["ours"].shape[1]
    draws = [rng.integers(0, count, (1 + len(ENRS_DB), count)) for _ in range(300)]

    def drawn(name: str) -> NDArray[np.float64]:
        rows = np.arange(1 + len(ENRS_DB))[:, None]
        return np.array([half_found_db(found[name][rows, draw]) for draw in draws])

    ours_db, ours_drawn = half_found_db(found["ours"]), drawn("ours")
    print(f"{count} stretches of each strength; half found by ours at {ours_db:.2f} dB")
    for name in WAYS:
        low, high = np.quantile(drawn(name) - ours_drawn, (0.025, 0.975))
        more_db = half_found_db(found[name]) - ours_db
        print(f"{name:24s} {more_db:+.2f} dB ({low:+.2f} … {high:+.2f})")


if __name__ == "__main__":
    main()
