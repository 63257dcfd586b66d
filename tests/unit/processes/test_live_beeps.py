"""A receiver names what beeps beside its tags while they are searched for."""

from dataclasses import replace
from pathlib import Path

import made
import pytest
from tests.unit.processes.test_radio_restart import Sink

from uavrt.config.settings import RecordingSettings, Settings
from uavrt.core.messages import Beep, BeepKind
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.processes.receiver import Receiver
from uavrt.drone.processes.samples import beep_listener
from uavrt_experiments.detection.beeping import CENTER_HZ, Beeper, Scene, blocks_of, regular

RATE_HZ = 1e6
TAG = made.tag(2, CENTER_HZ + 10_000.0, 1.254)


class Frame:
    """As much of a process as a receiver needs."""

    def __init__(self, directory: Path) -> None:
        self.sent: list[Beep] = []
        self.texts: list[str] = []
        self.flight = made.flight_info(
            directory, (TAG,), center_frequency_hz=CENTER_HZ, sample_rate_hz=RATE_HZ
        )
        self.assignment = Assignment(
            process="receiver",
            settings=Settings(recording=RecordingSettings(channels=False)),
            clock_offset_ns=0,
            flight=self.flight,
            worker_of_tag={TAG.tag_id: 0},
        )

    def notify(self, severity: int, text: str) -> None:
        """Keep a text for the operator."""
        self.texts.append(text)

    def send(self, topic: str, record: Beep) -> None:
        """Keep what beeps."""
        assert topic == "beep"
        self.sent.append(record)


def beeper(offset_hz: float, interval_s: float) -> Beeper:
    starts_s = regular(36.0, interval_s, 0.3)
    return Beeper(offset_hz=offset_hz, enr_db=22.0, width_s=0.02, starts_s=starts_s)


def test_a_wrong_label_and_an_animal_anywhere_in_the_radios_band_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beep_listener, "MOST_WAITING", 1000)
    monkeypatch.setattr(beep_listener, "_CLOSE_S", 60.0)
    frame = Frame(tmp_path)
    receiver = Receiver(frame, frame.flight, [Sink()])  # type: ignore[arg-type]
    scene = Scene(
        duration_s=36.0,
        sample_rate_hz=RATE_HZ,
        seed=3,
        beepers=(beeper(10_640.0, 1.26), beeper(-420_000.0, 0.9)),
    )
    for block in blocks_of(scene):
        receiver.process(replace(block, samples=block.samples * 1e-3))
    receiver.close()
    counters = receiver.counters()
    assert counters["beep_search_dropped_s"] == 0.0
    by_kind = {one.kind: one for one in frame.sent}
    assert set(by_kind) == {BeepKind.OFF_LABEL, BeepKind.UNLISTED}
    off = by_kind[BeepKind.OFF_LABEL]
    assert off.tag_ids == (2,)
    assert off.away_hz is not None
    assert abs(off.away_hz - 640.0) < 15.0
    assert abs(by_kind[BeepKind.UNLISTED].frequency_hz - CENTER_HZ + 420_000.0) < 15.0
    assert counters["beeping"] == 2
    assert frame.texts == ["tag 2, 640 Hz above its label"]
    first = next(one for one in frame.sent if one.kind is BeepKind.OFF_LABEL)
    assert first.pulses <= 12, "named within 15 s"
    assert off.pulses > first.pulses, "and again when there are twice as many"


def test_samples_that_the_search_cannot_take_in_time_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beep_listener, "MOST_WAITING", 0)
    frame = Frame(tmp_path)
    receiver = Receiver(frame, frame.flight, [Sink()])  # type: ignore[arg-type]
    scene = Scene(duration_s=2.0, sample_rate_hz=RATE_HZ, seed=3, beepers=())
    for block in blocks_of(scene):
        receiver.process(replace(block, samples=block.samples * 1e-3))
    receiver.close()
    assert receiver.counters()["beep_search_dropped_s"] == pytest.approx(2.0, abs=0.2)
    assert frame.sent == []
