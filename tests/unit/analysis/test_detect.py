from collections.abc import Sequence

import made
import numpy as np
import pytest

from uavrt.analysis.measure.recorded_pulses import DetectionChain, DetectionSummary, detect
from uavrt.core.errors import ConfigError, RadioStopped, TunerError, UsageError
from uavrt.core.messages import IQBlock, Pulse, Tag
from uavrt.radio.timing.sample_times import NominalTimes

CENTER_HZ = 148.7e6
START_NS = 1_700_000_000_000_000_000
TAG = made.tag(3, CENTER_HZ + 612.0, 1.0, interval_uncertainty_s=0.02, interval_jitter_s=0.005)


def beeping(rate_hz: float, seconds: float, offset_hz: float, seed: int = 1) -> np.ndarray:
    """A tag of 20 dB that beeps each second, half a second after the start, in noise."""
    t = np.arange(int(rate_hz * seconds)) / rate_hz
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((t.size, 2)).view(complex)[:, 0] / np.sqrt(2)
    amplitude = np.sqrt(100.0 / (0.020 * rate_hz))
    on = np.abs((t + 0.5) % 1.0 - 0.010) < 0.010
    return np.asarray(noise + amplitude * on * np.exp(2j * np.pi * offset_hz * t), np.complex64)


class Memory:
    """Samples from memory, in blocks of any size, with an end as wished."""

    def __init__(
        self,
        samples: np.ndarray,
        rate_hz: float,
        block: int = 1000,
        end: Exception | None = None,
    ) -> None:
        self.sample_rate_hz = rate_hz
        self.center_frequency_hz = CENTER_HZ
        self.total_samples = len(samples)
        self._samples, self._block, self._at = samples, block, 0
        self._times = NominalTimes(START_NS, rate_hz)
        self._end = EOFError() if end is None else end

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        samples = self._samples[self._at : self._at + self._block]
        if not len(samples):
            raise self._end
        block = made.iq_block(
            samples, self._at, self.sample_rate_hz, time_ns=self._times.time_ns(self._at)
        )
        self._at += len(samples)
        return block

    def close(self) -> None:
        pass


def run(source: Memory, tags: Sequence[Tag] = (TAG,)) -> list[Pulse]:
    found: list[Pulse] = []
    detect(source, tags, found.extend)
    return found


@pytest.mark.parametrize("rate_hz", [3750.0, 7500.0, 250e3, 375e3, 768e3])
def test_pulses_are_found_at_every_rate_where_they_were_sent(rate_hz: float) -> None:
    pulses = run(Memory(beeping(rate_hz, 8.0, 612.0), rate_hz, block=int(rate_hz / 7)))
    assert len(pulses) >= 7
    for pulse in pulses[3:]:
        assert pulse.frequency_hz == pytest.approx(TAG.frequency_hz, abs=8.0)
        place_s = (pulse.start_time_ns - START_NS) / 1e9 % 1.0
        assert place_s == pytest.approx(0.5, abs=0.004)
        assert pulse.snr_db == pytest.approx(20.0, abs=3.0)


def test_tags_in_one_channel_and_in_several_are_told_apart() -> None:
    rate_hz = 250e3
    tags = [
        made.tag(
            number,
            CENTER_HZ + offset,
            1.0,
            interval_uncertainty_s=0.02,
            interval_jitter_s=0.005,
        )
        for number, offset in enumerate((612.0, 2200.0, -40_100.0), start=1)
    ]
    samples = beeping(rate_hz, 6.0, 612.0, 1) + beeping(rate_hz, 6.0, -40_100.0, 2)
    found = {pulse.tag_id for pulse in run(Memory(samples, rate_hz, 21_850), tags)}
    assert found == {1, 3}


def test_values_that_are_not_numbers_do_no_lasting_harm() -> None:
    samples = beeping(250e3, 8.0, 612.0)
    samples[250_000:250_010] = np.nan
    samples[300_000] = np.inf
    summary = DetectionSummary()
    found: list[Pulse] = []
    detect(Memory(samples, 250e3, 21_850), [TAG], found.extend, summary=summary)
    assert summary.invalid_samples > 0
    assert len([p for p in found if p.start_time_ns > START_NS + 2_000_000_000]) >= 5


def test_pulses_found_before_a_failure_are_handed_over_and_the_failure_is_raised() -> None:
    found: list[Pulse] = []
    source = Memory(beeping(3750.0, 8.0, 612.0), 3750.0, end=RadioStopped("unplugged"))
    with pytest.raises(RadioStopped, match="unplugged"):
        detect(source, [TAG], found.extend)
    assert len(found) >= 7


def test_told_to_stop_it_hands_over_what_is_complete() -> None:
    found: list[Pulse] = []
    asked = iter(range(1000))
    summary = detect(
        Memory(beeping(3750.0, 60.0, 612.0), 3750.0, block=3750),
        [TAG],
        found.extend,
        should_stop=lambda: next(asked) >= 8,
    )
    assert summary.stopped
    assert summary.samples == 8 * 3750
    assert 6 <= len(found) <= 8
    assert summary.pulses == {3: len(found)}


def test_progress_is_told_after_each_block() -> None:
    seen: list[tuple[int, int | None]] = []
    source = Memory(beeping(3750.0, 1.0, 0.0), 3750.0, block=1000)
    detect(
        source, [TAG], lambda _: None, on_progress=lambda done, all_: seen.append((done, all_))
    )
    assert seen == [(1000, 3750), (2000, 3750), (3000, 3750), (3750, 3750)]


def test_what_cannot_be_searched_is_refused() -> None:
    with pytest.raises(ConfigError, match="tags"):
        DetectionChain([], sample_rate_hz=250e3, center_frequency_hz=CENTER_HZ)
    with pytest.raises(ConfigError, match="window"):
        DetectionChain(
            [TAG],
            sample_rate_hz=250e3,
            center_frequency_hz=CENTER_HZ,
            frequency_window_hz=float("nan"),
        )
    with pytest.raises(TunerError, match=r"148\.7"):
        DetectionChain([TAG], sample_rate_hz=250e3, center_frequency_hz=140e6)
    with pytest.raises(UsageError):
        DetectionChain([TAG], sample_rate_hz=5.0, center_frequency_hz=CENTER_HZ)
