"""A tag that beeps beside its window is told."""

from dataclasses import replace

import made
import numpy as np
import pytest
from numpy.typing import NDArray
from uavrt.analysis.measure.pulse_search import Bursts, BurstSearch

from uavrt.analysis.measure.outside import LEAST_DB, OutsideSearch
from uavrt_experiments.detection.signals import THESIS_TAG, make_samples

RATE_HZ = 7500.0
WINDOW_HZ = 500.0


def heard(
    *signals: tuple[float, float, float],
    seed: int = 1,
    lost_each: tuple[int, int] = (0, 1),
) -> list[str]:
    """Search 40 s with signals of (offset from the tag, ENR in dB, interval in s).

    Of each so many blocks of 87 ms the first few may be lost.
    """
    rng = np.random.default_rng(seed)
    pulses = [
        pulse
        for offset_hz, enr_db, interval_s in signals
        for pulse in made.train(rng, 40.0, enr_db, interval_s=interval_s, offset_hz=offset_hz)
    ]
    samples = make_samples(rng, pulses, duration_s=40.0, sample_rate_hz=RATE_HZ)
    search = OutsideSearch((THESIS_TAG, replace(THESIS_TAG, tag_id=4)), WINDOW_HZ)
    lost, of = lost_each
    end = 0
    for number, first in enumerate(range(0, len(samples), 653)):
        if number % of < lost:
            continue
        search.add(
            made.channel_block(
                samples[first : first + 653],
                first,
                RATE_HZ,
                center_frequency_hz=THESIS_TAG.frequency_hz,
                lost_before=first - end,
            )
        )
        end = first + 653
    return [str(found) for found in search.finish()]


def test_a_strong_tag_beside_its_window_is_told_with_the_remedy() -> None:
    said = heard((1500.0, 26.0, 1.26))
    assert len(said) == 2  # both tags have this frequency and interval
    assert "1.5 kHz above tag 2" in said[0] + said[1]
    assert any(f"--frequency-window? ({hz} would reach it)" in said[0] for hz in (1700, 1800))
    level_db = float(said[0].split(" dB")[0])
    assert level_db == pytest.approx(26.0, abs=4.0)
    assert "0.9 kHz below" in heard((-900.0, 26.0, 1.26))[0]


def test_a_tag_is_told_where_a_part_of_each_second_is_lost() -> None:
    said = heard((1500.0, 26.0, 1.26), lost_each=(3, 12))
    assert "1.5 kHz above tag 2" in said[0] + said[1]


@pytest.mark.parametrize("seed", range(3))
def test_nothing_else_is_told(seed: int) -> None:
    assert heard(seed=seed) == []
    # Within the window, another's interval, and the flanks of a very strong pulse.
    assert heard((100.0, 26.0, 1.254), seed=seed) == []
    assert heard((1500.0, 26.0, 0.83), seed=seed) == []
    assert heard((300.0, 55.0, 1.254), seed=seed) == []


@pytest.mark.parametrize("enr_db", [48.0, 51.0, 54.0])
@pytest.mark.parametrize("seed", range(2))
def test_what_the_next_channel_hears_of_a_strong_tags_edges_is_not_told(
    enr_db: float, seed: int
) -> None:
    """The tag itself lies beyond that channel's reach, its edges do not."""
    search = OutsideSearch((THESIS_TAG,), WINDOW_HZ)
    for channel, offset_hz in enumerate((800.0, -2950.0)):
        rng = np.random.default_rng(seed)
        pulses = made.train(rng, 40.0, enr_db, offset_hz=offset_hz)
        search.add(
            made.channel_block(
                make_samples(rng, pulses, duration_s=40.0, sample_rate_hz=RATE_HZ),
                0,
                RATE_HZ,
                channel=channel,
                center_frequency_hz=THESIS_TAG.frequency_hz - offset_hz,
            )
        )
    assert search.finish() == []


def bursts(samples: NDArray[np.complex64], *, glance: bool) -> Bursts:
    """Search a channel, two seconds at a time."""
    search = BurstSearch(
        sample_rate_hz=RATE_HZ,
        low_hz=-2250.0,
        high_hz=2250.0,
        least_db=LEAST_DB,
        hop_s=0.008,
        glance=glance,
    )
    for first in range(0, len(samples), 15_000):
        search.process(samples[first : first + 15_000])
    return search.finish()


@pytest.mark.parametrize("seed", range(3))
def test_a_glance_finds_the_bursts_that_a_look_at_every_window_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pulses = [
        pulse
        for offset_hz, enr_db in ((-1500.0, 19.0), (700.0, 24.0), (1900.0, 30.0))
        for pulse in made.train(rng, 60.0, enr_db, interval_s=1.3, offset_hz=offset_hz)
    ]
    samples = make_samples(rng, pulses, duration_s=60.0, sample_rate_hz=RATE_HZ)
    # The noise doubles half-way: the usual levels are measured again.
    samples[len(samples) // 2 :] *= np.float32(2.0**0.5)
    every, some = bursts(samples, glance=False), bursts(samples, glance=True)
    assert np.count_nonzero(every.levels_db > 16.5) > 100
    for time_s, frequency_hz, level_db in np.stack(
        (every.times_s, every.frequencies_hz, every.levels_db), axis=1
    )[every.levels_db > 16.5].tolist():
        near = np.abs(some.times_s - time_s) < 0.02
        near &= np.abs(some.frequencies_hz - frequency_hz) < 30.0
        assert some.levels_db[near] == pytest.approx(level_db, abs=1.5), time_s


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_a_carrier_that_begins_after_the_first_look_is_no_burst(share: float) -> None:
    """Else it passes for one wherever a pulse raises the energy, at the pulses' interval."""
    rng = np.random.default_rng(5)
    pulses = made.train(rng, 60.0, 26.0, interval_s=1.3)
    samples = make_samples(rng, pulses, duration_s=60.0, sample_rate_hz=RATE_HZ)
    noise = float(np.median(np.abs(samples) ** 2)) / np.log(2.0)
    at = np.arange(len(samples))
    wave = np.sqrt(share * noise) * np.exp(2j * np.pi * 1000.0 / RATE_HZ * at)
    samples += (wave * (at > 20.0 * RATE_HZ)).astype(np.complex64)
    found = bursts(samples, glance=True)
    carrier = np.abs(found.frequencies_hz - 1000.0) < 60.0
    assert np.count_nonzero(carrier & (found.times_s > 24.0)) < 3  # of 28 pulses
    assert np.count_nonzero(np.abs(found.frequencies_hz) < 60.0) > 40
