from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt.config.settings import DetectionSettings, OperatingModeName
from uavrt.core.messages import ChannelBlock, Tag
from uavrt.detection.detector import PulseDetector
from uavrt.drone.processes.detector import DetectorBank
from uavrt.drone.processes.samples import hang_watch

RATE_HZ = 7500.0
CENTER_HZ = 148_710_000.0


def tag(tag_id: int, frequency_hz: float) -> Tag:
    return made.tag(tag_id, frequency_hz, interval_uncertainty_s=0.06, interval_jitter_s=0.01)


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
        made.channel_block(
            samples[start : start + size].astype(np.complex64),
            start,
            RATE_HZ,
            center_frequency_hz=CENTER_HZ,
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


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("where", ["search", "next_step", "process"])
def test_a_tag_at_which_the_search_fails_twice_is_left_out_and_the_others_go_on(
    where: str, times: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    original, left = getattr(PulseDetector, where), [times]

    def failing(self: PulseDetector, *arguments: object, **options: object) -> object:
        if self.tag.tag_id == 5 and left[0] and self.counters.samples > 0.6 * RATE_HZ:
            left[0] -= 1
            raise FloatingPointError("no threshold")
        return original(self, *arguments, **options)

    monkeypatch.setattr(PulseDetector, where, failing)
    sick = replace(tag(5, CENTER_HZ - 1500.0), name="fox")
    bank = DetectorBank((tag(2, CENTER_HZ + 150.0), sick), DetectionSettings())
    stream = blocks(2.0)
    if where == "process":  # which is what irregular blocks come to
        stream = [
            replace(block, time_ns=block.time_ns + 10**7 * (n % 2))
            for n, block in enumerate(stream[:40])
        ] + stream[40:]
    found = run(bank, stream)
    assert left == [0]
    counters = bank.counters()
    assert counters["detector_failures"] == times
    assert counters["tags_left_out"] == times - 1
    assert bank.complete
    said = capsys.readouterr().err
    assert ('"tag": "5 fox"' in said) is (times == 2)
    assert len(found) >= 5, "of the ten; some samples go with the failures"


def test_a_tag_whose_search_does_not_end_is_left_out_and_the_others_go_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(hang_watch, "CHECK_S", 0.05)
    search = PulseDetector.search

    def hanging(self: PulseDetector, *, last: bool = False) -> None:
        while self.tag.tag_id == 5 and self.counters.samples > 0.6 * RATE_HZ:
            pass
        search(self, last=last)

    monkeypatch.setattr(PulseDetector, "search", hanging)
    sick = replace(tag(5, CENTER_HZ - 1500.0), name="fox")
    bank = DetectorBank((tag(2, CENTER_HZ + 150.0), sick), DetectionSettings())
    assert len(run(bank, blocks(2.0))) >= 5
    assert list(bank.left_out) == [5]
    said = capsys.readouterr().err
    assert '"tag": "5 fox", "reason": "the search did not finish within' in said


def compute_without_end(turn: object) -> None:
    with hang_watch.HangWatch(lambda: turn):
        while True:
            pass


def test_many_turns_of_a_search_do_not_count_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hang_watch, "CHECK_S", 0.002)
    turn = [object()]
    with hang_watch.HangWatch(lambda: turn[0]):
        for _ in range(400_000):
            turn[0] = object()
    with pytest.raises(hang_watch.SearchHangs):
        compute_without_end(turn[0])


def test_a_tag_that_no_detector_takes_costs_no_other(
    capsys: pytest.CaptureFixture[str],
) -> None:
    wide = replace(tag(5, CENTER_HZ - 150.0), pulse_width_s=0.7, name="fox")
    bank = DetectorBank((wide, tag(2, CENTER_HZ + 150.0)), DetectionSettings())
    assert len(run(bank, blocks(2.0))) == 10
    assert list(bank.left_out) == [5]
    assert '"tag": "5 fox"' in capsys.readouterr().err
