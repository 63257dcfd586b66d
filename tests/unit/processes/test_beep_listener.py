"""The thread that searches for what beeps: a new search starts empty, a failure is reported."""

import threading
from dataclasses import dataclass, field
from pathlib import Path

import made
import numpy as np
import pytest
from tests.unit.processes.test_live_beeps import RATE_HZ, Frame
from tests.unit.processes.test_radio_restart import Sink

from uavrt.core.messages import Beep, BeepKind, IQBlock
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.drone.processes.receiver import Receiver
from uavrt.drone.processes.samples.beep_listener import BeepListener
from uavrt_experiments.detection.beeping import CENTER_HZ


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
    frame = Frame(tmp_path)
    receiver = Receiver(frame, frame.flight, [Sink()])  # type: ignore[arg-type]
    samples = np.full(200_000, 1e-3, np.complex64)
    for number in range(5):
        receiver.process(IQBlock(samples, number * samples.size, number * 200_000_000, RATE_HZ))
    receiver.close()
    assert frame.texts == ["Unlisted tags no longer searched: internal fault"]
    assert receiver.counters()["samples"] == 1_000_000
