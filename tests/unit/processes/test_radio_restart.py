"""Samples that the air brought while the radio was opened again are counted as lost."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest

from uavrt.messages import IQBlock
from uavrt.processes.receiver import Receiver

RATE_HZ = 3e6
SIZE = 65_536
TAG = made.tag()


class Sink:
    """A detector that takes everything."""

    samples_dropped = 0

    def send(self, block: object) -> None:
        """Take it."""

    def flush(self) -> None:
        """Nothing waits."""


def block_at(time_ns: int, lost: int = 0) -> IQBlock:
    return made.iq_block(
        np.zeros(SIZE, np.complex64), 0, RATE_HZ, start_ns=time_ns, lost_before=lost
    )


def make_receiver(directory: Path) -> Receiver:
    from uavrt.config.settings import RecordingSettings, Settings
    from uavrt.ipc.assignment import Assignment

    flight = made.flight_info(directory, (TAG,), sample_rate_hz=RATE_HZ)
    assignment = Assignment(
        process="receiver",
        settings=Settings(recording=RecordingSettings(directory=str(directory))),
        clock_offset_ns=0,
        flight=flight,
    )
    assignment = replace(assignment, worker_of_tag={2: 0})

    class Frame:
        """As much of a process as a receiver needs."""

        def tell(self, severity: int, text: str) -> None:
            """Nobody listens."""

    frame: Any = Frame()
    frame.assignment = assignment
    return Receiver(frame, flight, [Sink()])


@pytest.mark.parametrize("failed", [True, False])
def test_what_was_missed_while_the_radio_was_opened_again_is_lost(
    tmp_path: Path, failed: bool
) -> None:
    receiver = make_receiver(tmp_path)
    start_ns = 10**18
    receiver.process(block_at(start_ns, lost=7))
    assert receiver.samples_lost == 7, "nothing before the first block"
    end_ns = start_ns + round(SIZE * 1e9 / RATE_HZ)
    receiver.forget(failed=failed)
    receiver.process(block_at(end_ns + 2 * 10**9))
    assert receiver.samples_lost == pytest.approx(7 + 2 * RATE_HZ, abs=2)
    receiver.process(block_at(end_ns + 2 * 10**9 + round(SIZE * 1e9 / RATE_HZ)))
    assert receiver.samples_lost == pytest.approx(7 + 2 * RATE_HZ, abs=2)
    assert receiver.failures == failed
