"""Detectors find the same pulses with the compiled kernels and without."""

import math
from dataclasses import replace
from functools import cache

import made
import numpy as np
import pytest
from depth import share
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, Tag
from uavrt.core.runtime import native
from uavrt.detection.group import DetectorGroup
from uavrt.detection.search.grid import Spectrogram, make_grid
from uavrt.detection.search.levelling import Leveller
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG, make_samples

pytestmark = pytest.mark.slow

needs_kernels = pytest.mark.skipif(
    native.kernels() is None, reason=f"{native.description()}: python hatch_build.py kernels"
)
RATE_HZ = 7500.0
SHORT = replace(THESIS_TAG, pulse_width_s=0.010)
NARROW = replace(THESIS_TAG, k=20, interval_uncertainty_s=0.000125, interval_jitter_s=0.002)


def found(tag: Tag, *, window_hz: float, enr_db: float, seed: int) -> list[Pulse]:
    """Three detectors beside a tag of theirs, a carrier and an impulse, as a group."""
    rng = np.random.default_rng(seed)
    seconds = 12.0 if tag.k < 9 else 32.0
    width_s = tag.pulse_width_s
    pulses = made.train(rng, seconds, enr_db, offset_hz=80.0)
    samples = make_samples(rng, pulses, duration_s=seconds, sample_rate_hz=RATE_HZ)
    level = float(np.abs(samples).std()) / width_s**0.5
    time_s = np.arange(len(samples)) / RATE_HZ
    samples += (0.2 * level * np.exp(2j * np.pi * 1234.0 * time_s)).astype(np.complex64)
    samples[40_000:40_006] += np.complex64(30.0 * level)
    group = DetectorGroup()
    for index in range(3):
        detector = made.detector(
            replace(tag, tag_id=2 * index + 2),
            RATE_HZ,
            center_frequency_hz=tag.frequency_hz - 30.0 * index,
            frequency_window_hz=window_hz,
        )
        group.add(index, [detector])
    heard: list[Pulse] = []
    for first in range(0, len(samples), 653):
        for index in range(3):
            block = samples[first : first + 653]
            group.put(index, block, START_NS + round(first / RATE_HZ * 1e9))
        heard += group.collect()
    return heard + group.flush()


@cache
def found_by_numpy(tag: Tag, *, window_hz: float, enr_db: float) -> list[Pulse]:
    """The same for every processor."""
    with native.numpy_only():
        return found(tag, window_hz=window_hz, enr_db=enr_db, seed=5)


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize(
    ("tag", "window_hz", "enr_db"),
    share(
        [
            (THESIS_TAG, 500.0, 20.0),
            (THESIS_TAG, 500.0, 11.0),
            (NARROW, 100.0, 9.0),
            (replace(THESIS_TAG, k=1), 500.0, 18.0),
            (replace(THESIS_TAG, k=5), 200.0, 10.0),
            (THESIS_TAG, math.inf, 14.0),
            (replace(THESIS_TAG, false_alarm_probability=0.5), 500.0, -20.0),
        ],
        2,
    ),
)
def test_the_pulses_are_the_same(tag: Tag, window_hz: float, enr_db: float) -> None:
    one = found(tag, window_hz=window_hz, enr_db=enr_db, seed=5)
    two = found_by_numpy(tag, window_hz=window_hz, enr_db=enr_db)
    assert len(one) == len(two)
    assert len(one) > (0 if enr_db < 0.0 else 5)
    for mine, other in zip(one, two, strict=True):
        for name in ("tag_id", "group_index", "group_sequence", "detection_status"):
            assert getattr(mine, name) == getattr(other, name)
        assert abs(mine.start_time_ns - other.start_time_ns) < 0.01 / RATE_HZ * 1e9
        assert mine.frequency_hz == pytest.approx(other.frequency_hz, abs=0.01)
        assert mine.snr_db == pytest.approx(other.snr_db, abs=1e-3)
        assert mine.group_snr_db == pytest.approx(other.group_snr_db, abs=1e-3)


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize("width_s", [0.0077, 0.010, 0.020, 0.033])
@pytest.mark.parametrize("half_width_hz", [60.0, 500.0, 1400.0])
@pytest.mark.parametrize("offset_hz", [0.0, 333.0, -3500.0])
def test_the_cells_are_the_same(width_s: float, half_width_hz: float, offset_hz: float) -> None:
    rng = np.random.default_rng(3)
    samples = rng.standard_normal((9000, 2), np.float32).view(np.complex64)[:, 0]
    grid = make_grid(
        sample_rate_hz=RATE_HZ,
        pulse_width_s=width_s,
        offset_hz=offset_hz,
        half_width_hz=half_width_hz,
    )
    by_kernels, by_numpy = Spectrogram(grid), Spectrogram(grid)
    first = 0
    for upto in (600, 3000, 3001, 3100, 9000):
        one = by_kernels.push(samples[first:upto])
        with native.numpy_only():
            two = by_numpy.push(samples[first:upto])
        np.testing.assert_allclose(one, two, rtol=0.0, atol=3e-5)
        np.testing.assert_allclose(by_kernels.band, by_numpy.band, rtol=0.0, atol=3e-6)
        assert by_kernels.consumed == by_numpy.consumed
        first = by_kernels.consumed * grid.decimation


@needs_kernels
@pytest.mark.parametrize("rows", [9, 81, 83, 600])
@pytest.mark.parametrize("scene", ["steady", "step", "half", "pulses", "holes", "silence"])
def test_the_levels_are_the_same(rows: int, scene: str) -> None:
    rng = np.random.default_rng(4)
    power = rng.exponential(1.0, (rows, 1200)).astype(np.float32)
    whole: list[NDArray[np.bool_] | None] = [None] * 20
    if scene == "step":
        power[:, 500:800] *= 4.0
    elif scene == "half":
        power[: rows // 2, 500:800] *= 4.0
    elif scene == "pulses":
        for column in range(100, 1200, 173):
            power[:, column : column + 8] += 20.0
    elif scene == "holes":
        whole = [rng.random(60) > 0.3 for _ in range(20)]
    elif scene == "silence":
        power[:, 300:500] = 0.0
    noise = np.linspace(0.8, 1.3, rows).astype(np.float32)

    def levelled() -> tuple[NDArray[np.float32], list[float], list[bool], list[float]]:
        leveller = Leveller(rows=rows, keep=1600, steepness=10.0, circular=rows == 600)
        parts, unsteady, now = [], [], []
        for index, good in enumerate(whole):
            part = power[:, 60 * index : 60 * index + 60] * noise[:, np.newaxis]
            leveller.level(part, noise, 60 * index, good)
            parts.append(part)
            unsteady.append(leveller.unsteady)
            now.append(float(leveller.rows_now.mean()))
        told = [
            leveller.record.at(row, column) for row in (0, rows - 1) for column in range(1200)
        ]
        return np.concatenate(parts, axis=1), told, unsteady, now

    one = levelled()
    with native.numpy_only():
        two = levelled()
    np.testing.assert_allclose(one[0], two[0], rtol=2e-5)
    np.testing.assert_allclose(one[1], two[1], rtol=2e-5)
    assert one[2] == two[2]
    # Of few rows pulses are no louder than chance.
    changes = scene in ("step", "half", "silence") or (scene == "pulses" and rows > 9)
    assert any(one[2]) == changes
    np.testing.assert_allclose(one[3], two[3], rtol=2e-5)
