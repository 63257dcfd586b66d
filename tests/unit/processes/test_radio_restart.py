"""Samples that the air brought while the radio was opened again are counted as lost.

A disk that fills up is reported each time.
"""

from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from receiving import Frame, receiving

from uavrt.config.settings import RecordingSettings
from uavrt.core.messages import IQBlock
from uavrt.drone.processes.receiver import Receiver

RATE_HZ = 3e6
SIZE = 65_536


def block_at(time_ns: int, lost: int = 0) -> IQBlock:
    return made.iq_block(
        np.full(SIZE, 0.01, np.complex64), 0, RATE_HZ, start_ns=time_ns, lost_before=lost
    )


def make_receiver(directory: Path) -> tuple[Receiver, Frame]:
    flight = made.flight_info(directory, (made.tag(),), sample_rate_hz=RATE_HZ)
    return receiving(flight, RecordingSettings(directory=str(directory)))


@pytest.mark.parametrize("failed", [True, False])
def test_what_a_radio_missed_as_it_was_opened_is_lost(tmp_path: Path, failed: bool) -> None:
    receiver, _ = make_receiver(tmp_path)
    start_ns = 10**18
    receiver.process(block_at(start_ns, lost=7))
    assert receiver.samples_lost == 7, "nothing before the first block"
    end_ns = start_ns + round(SIZE * 1e9 / RATE_HZ)
    receiver.restart_filters(failed=failed)
    receiver.process(block_at(end_ns + 2 * 10**9))
    assert receiver.samples_lost == pytest.approx(7 + 2 * RATE_HZ, abs=2)
    receiver.process(block_at(end_ns + 2 * 10**9 + round(SIZE * 1e9 / RATE_HZ)))
    assert receiver.samples_lost == pytest.approx(7 + 2 * RATE_HZ, abs=2)
    assert receiver.failures == failed


class Disk:
    """A recorder of the band whose disk fills up and is emptied."""

    trouble: str | None = None
    written_samples = 0

    def put(self, block: IQBlock) -> None:
        """Write what the disk takes."""
        if self.trouble is None:
            self.written_samples += len(block.samples)


def test_a_disk_full_again_is_reported_again_and_a_flickering_one_once(tmp_path: Path) -> None:
    receiver, frame = make_receiver(tmp_path)
    disk: Any = Disk()
    receiver._recorder = disk
    start_ns = 10**18
    said: list[int] = []

    def texts() -> list[str]:
        return [text for text in frame.texts if "recorded" in text]

    for trouble, seconds in (
        (None, 3.0),
        *[("the disk is nearly full", 0.1), (None, 0.1)] * 5,
        (None, 12.0),
        ("the disk is nearly full", 3.0),
    ):
        disk.trouble = trouble
        for _ in range(round(seconds * RATE_HZ / SIZE)):
            receiver.process(block_at(start_ns))
            start_ns += round(SIZE * 1e9 / RATE_HZ)
        said.append(len(texts()))
    assert said == [0] + [1] * 11 + [2], texts()
    first, second = texts()
    assert first == "Band no longer recorded: the disk is nearly full. 3 s are kept"
    assert second == "Band no longer recorded: the disk is nearly full. 16 s are kept"
