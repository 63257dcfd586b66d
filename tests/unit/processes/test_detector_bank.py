import numpy as np
import pytest

from uavrt.config.settings import DetectionSettings, OperatingModeName
from uavrt.messages import ChannelBlock, Tag
from uavrt.processes.detector import DetectorBank

RATE_HZ = 7500.0
CENTER_HZ = 148_710_000.0


def tag(tag_id: int, frequency_hz: float) -> Tag:
    return Tag(
        tag_id=tag_id,
        frequency_hz=frequency_hz,
        pulse_width_s=0.02,
        pulse_intervals_s=(1.254,),
        interval_uncertainty_s=0.06,
        interval_jitter_s=0.01,
    )


def blocks(amplitude: float, *, bad_at_s: float | None = None) -> list[ChannelBlock]:
    """Twelve seconds of noise with pulses every 1.254 s at +200 Hz, in blocks of 0.1 s."""
    rng = np.random.default_rng(7)
    count = round(12 * RATE_HZ)
    samples = rng.standard_normal(count) + 1j * rng.standard_normal(count)
    times = np.arange(count) / RATE_HZ
    on = (times - 0.4) % 1.254 < 0.02
    samples += amplitude * on * np.exp(2j * np.pi * 200.0 * times)
    if bad_at_s is not None:
        samples[round(bad_at_s * RATE_HZ)] = np.nan
    size = round(0.1 * RATE_HZ)
    return [
        ChannelBlock(
            channel=0,
            center_frequency_hz=CENTER_HZ,
            samples=samples[start : start + size].astype(np.complex64),
            sample_index=start,
            time_ns=round(start * 1e9 / RATE_HZ),
            sample_rate_hz=RATE_HZ,
        )
        for start in range(0, count, size)
    ]


def run(bank: DetectorBank, stream: list[ChannelBlock]) -> list[int]:
    found = []
    for block in stream:
        bank.put(block)
        found += bank.collect()
    found += bank.flush()
    return sorted(pulse.start_time_ns for pulse in found if pulse.tag_id == 2)


def test_a_bank_finds_the_pulses_of_the_tags_of_its_channel_only() -> None:
    other = tag(4, CENTER_HZ + 3 * 3750.0)
    bank = DetectorBank((tag(2, CENTER_HZ + 150.0), other), DetectionSettings())
    assert len(run(bank, blocks(2.0))) == 10
    assert bank.counters()["detectors"] == 1
    assert not bank.complete  # the other tag's channel has not come


def test_a_sample_that_is_no_number_costs_nothing_but_itself() -> None:
    bank = DetectorBank((tag(2, CENTER_HZ + 150.0),), DetectionSettings())
    assert len(run(bank, blocks(2.0, bad_at_s=5.0))) == 10
    assert bank.counters()["samples_invalid"] == 1


@pytest.mark.parametrize(
    ("mode", "nominal_hz", "found"),
    [
        ("freqSearchSoftLock", 20.0, 10),
        ("freqKnownHardLock", 20.0, 0),
        ("freqKnownHardLock", 180.0, 10),
        ("freqSearchSoftLock", -400.0, 0),
        ("freqAllNeverLock", -400.0, 10),
    ],
)
def test_a_bank_searches_in_the_mode_of_the_settings(
    mode: OperatingModeName, nominal_hz: float, found: int
) -> None:
    settings = DetectionSettings(operating_mode=mode)
    bank = DetectorBank((tag(2, CENTER_HZ + nominal_hz),), settings)
    assert len(run(bank, blocks(2.0))) == pytest.approx(found, abs=1)


def test_a_bank_with_a_hard_lock_keeps_to_the_frequency_that_it_found() -> None:
    settings = DetectionSettings(operating_mode="freqSearchHardLock")
    bank = DetectorBank((tag(2, CENTER_HZ + 20.0),), settings)
    for block in blocks(2.0):
        bank.put(block)
        bank.collect()
    assert bank.all()[0].locked_frequency_hz == pytest.approx(CENTER_HZ + 200.0, abs=5.0)
