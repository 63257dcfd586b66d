"""A tag that beeps beside its window is told."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.analysis.measure.outside import OutsideSearch
from uavrt.messages import ChannelBlock
from uavrt_experiments.detection.signals import THESIS_TAG, make_samples, pulse_train

RATE_HZ = 7500.0
WINDOW_HZ = 500.0


def heard(*signals: tuple[float, float, float], seed: int = 1) -> list[str]:
    """Search 40 s with signals of (offset from the tag, ENR in dB, interval in s)."""
    rng = np.random.default_rng(seed)
    pulses = [
        pulse
        for offset_hz, enr_db, interval_s in signals
        for pulse in pulse_train(
            rng, duration_s=40.0, interval_s=interval_s, offset_hz=offset_hz, enr_db=enr_db
        )
    ]
    samples = make_samples(rng, pulses, duration_s=40.0, sample_rate_hz=RATE_HZ)
    search = OutsideSearch((THESIS_TAG, replace(THESIS_TAG, tag_id=4)), WINDOW_HZ)
    for first in range(0, len(samples), 653):
        search.add(
            ChannelBlock(
                channel=0,
                center_frequency_hz=THESIS_TAG.frequency_hz,
                samples=samples[first : first + 653],
                sample_index=first,
                time_ns=round(first / RATE_HZ * 1e9),
                sample_rate_hz=RATE_HZ,
            )
        )
    return [str(found) for found in search.finish()]


def test_a_strong_tag_beside_its_window_is_told_with_the_remedy() -> None:
    said = heard((1500.0, 26.0, 1.26))
    assert len(said) == 2  # both tags have this frequency and interval
    assert "1.5 kHz above tag 2" in said[0] + said[1]
    assert any(f"--frequency-window? ({hz} would reach it)" in said[0] for hz in (1700, 1800))
    level_db = float(said[0].split(" dB")[0])
    assert level_db == pytest.approx(26.0, abs=4.0)
    assert "0.9 kHz below" in heard((-900.0, 26.0, 1.26))[0]


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
        pulses = pulse_train(
            rng, duration_s=40.0, interval_s=1.254, offset_hz=offset_hz, enr_db=enr_db
        )
        search.add(
            ChannelBlock(
                channel=channel,
                center_frequency_hz=THESIS_TAG.frequency_hz - offset_hz,
                samples=make_samples(rng, pulses, duration_s=40.0, sample_rate_hz=RATE_HZ),
                sample_index=0,
                time_ns=0,
                sample_rate_hz=RATE_HZ,
            )
        )
    assert search.finish() == []
