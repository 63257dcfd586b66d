"""A receiver names what beeps beside its tags while they are searched for."""

import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import made
import numpy as np
import pytest
from receiving import Frame, receiving

from uavrt.config.settings import RecordingSettings
from uavrt.core.messages import Beep, BeepKind, IQBlock
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.drone.processes.samples import beep_listener
from uavrt.drone.processes.samples.beep_listener import BeepListener
from uavrt_experiments.detection.beeping import CENTER_HZ, Beeper, Scene, blocks_of, regular

RATE_HZ = 5e5
TAG = made.tag(2, CENTER_HZ + 10_000.0, 1.254)


def listen(directory: Path, scene: Scene) -> tuple[Mapping[str, float], Frame]:
    """Let a receiver search the band beside its tag; its counters."""
    flight = made.flight_info(
        directory, (TAG,), center_frequency_hz=CENTER_HZ, sample_rate_hz=RATE_HZ
    )
    receiver, frame = receiving(flight, RecordingSettings(channels=False))
    for block in blocks_of(scene):
        receiver.process(replace(block, samples=block.samples * 1e-3))
    receiver.close()
    return receiver.counters(), frame


def beeper(offset_hz: float, interval_s: float) -> Beeper:
    starts_s = regular(36.0, interval_s, 0.3)
    return Beeper(offset_hz=offset_hz, enr_db=22.0, width_s=0.02, starts_s=starts_s)


def test_a_wrong_label_and_an_animal_anywhere_in_the_radios_band_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beep_listener, "MOST_WAITING", 1000)
    monkeypatch.setattr(beep_listener, "_CLOSE_S", 60.0)
    scene = Scene(
        duration_s=36.0,
        sample_rate_hz=RATE_HZ,
        seed=3,
        beepers=(beeper(10_640.0, 1.26), beeper(-210_000.0, 0.9)),
    )
    counters, frame = listen(tmp_path, scene)
    assert counters["beep_search_dropped_s"] == 0.0
    by_kind = {one.kind: one for one in frame.beeps}
    assert set(by_kind) == {BeepKind.OFF_LABEL, BeepKind.UNLISTED}
    off = by_kind[BeepKind.OFF_LABEL]
    assert off.tag_ids == (2,)
    assert off.away_hz is not None
    assert abs(off.away_hz - 640.0) < 15.0
    assert abs(by_kind[BeepKind.UNLISTED].frequency_hz - CENTER_HZ + 210_000.0) < 15.0
    assert counters["beeping"] == 2
    (text,) = frame.texts
    assert re.fullmatch(r"tag 2, 6[34]\d Hz above its label", text)
    first = next(one for one in frame.beeps if one.kind is BeepKind.OFF_LABEL)
    assert first.pulses <= 12, "named within 15 s"
    assert off.pulses > first.pulses, "and again when there are twice as many"


def test_samples_that_the_search_cannot_take_in_time_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beep_listener, "MOST_WAITING", 0)
    scene = Scene(duration_s=2.0, sample_rate_hz=RATE_HZ, seed=3, beepers=())
    counters, frame = listen(tmp_path, scene)
    assert counters["beep_search_dropped_s"] == pytest.approx(2.0, abs=0.2)
    assert frame.beeps == []


@dataclass
class Search:
    """Names one sender in each block, once it may go on."""

    place_hz: float
    goes_on: threading.Event
    taken: list[int] = field(default_factory=list)
    dropped: int = 0

    def due(self, block: IQBlock, band: IQBlock) -> tuple[IQBlock, IQBlock]:
        """Want all blocks."""
        return block, band

    def take(self, block: IQBlock, band: IQBlock) -> None:
        """Search a block when it may."""
        self.goes_on.wait(30.0)
        self.taken.append(block.sample_index)

    def news(self, now_ns: int) -> list[Beep]:
        """Name a sender."""
        return [made.beep(BeepKind.UNLISTED, frequency_hz=self.place_hz, time_ns=now_ns)]


def block(number: int) -> IQBlock:
    samples = np.zeros(100, np.complex64)
    return IQBlock(samples, 100 * number, 0, RATE_HZ)


def test_what_waits_for_a_search_that_is_replaced_is_discarded_with_its_news() -> None:
    goes_on = threading.Event()
    searches = [Search(CENTER_HZ, goes_on), Search(CENTER_HZ + 5e3, goes_on)]
    left = iter(searches)
    listener = BeepListener(lambda: next(left))  # type: ignore[arg-type, return-value]
    for number in range(3):
        listener.add(block(number), block(number))
    listener.begin_again()
    listener.add(block(3), block(3))
    goes_on.set()
    listener.close()
    assert [one.frequency_hz for one in listener.take_found()] == [CENTER_HZ + 5e3]
    assert searches[1].taken == [300]
    assert len(searches[0].taken) <= 1, "the one that was under way"


def test_a_search_that_fails_is_reported_to_the_operator_once_and_samples_flow_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_given: object) -> None:
        raise IndexError("a fault of ours")

    monkeypatch.setattr(BeepSearch, "take", fail)
    flight = made.flight_info(
        tmp_path, (TAG,), center_frequency_hz=CENTER_HZ, sample_rate_hz=RATE_HZ
    )
    receiver, frame = receiving(flight, RecordingSettings(channels=False))
    samples = np.full(200_000, 1e-3, np.complex64)
    for number in range(5):
        receiver.process(IQBlock(samples, number * samples.size, number * 400_000_000, RATE_HZ))
    receiver.close()
    assert frame.texts == ["Unlisted tags no longer searched: internal fault"]
    assert receiver.counters()["samples"] == 1_000_000
