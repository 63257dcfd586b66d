"""Detect pulses in one cell, which is a time span of a recording."""

import errno
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from uavrt.analysis.archive.parquet.seals import read_note, write_note
from uavrt.analysis.archive.recordings import Recording, out_of_reach
from uavrt.analysis.archive.steps.recording_cells import Cell
from uavrt.analysis.measure.recorded_pulses import DetectionChain
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.config.ghost_places import Receiver
from uavrt.core.errors import FormatError, UavrtError
from uavrt.core.messages import Beep, Pulse
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.radio.files.recording_source import RecordingSource


class CellResult(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one cell: pulses, signals that differ from the tag list, and counters."""

    number: int
    pulses: list[Pulse] = msgspec.field(default_factory=list)
    beeps: list[Beep] = msgspec.field(default_factory=list)
    input_faults: list[str] = msgspec.field(default_factory=list)
    """Faults of the recording's samples in the cell, such as a wrong gain."""
    lost_samples: int = 0
    invalid_values: int = 0
    cpu_s: float = 0.0
    searched: bool = False
    """True if at least one sample of the cell was searched."""
    fault: str | None = None
    """Reason why the search of the cell failed or stopped early; None if it is complete."""
    unreachable: bool = False
    """True if the cell's samples could not be read now, so that the next run tries again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTask:
    """Task for a worker: detect pulses in one cell."""

    recording: Recording
    cell: Cell
    sought: TagSource
    frequency_window_hz: float

    def packed(self) -> "CellTask":
        """Return the task unchanged: the worker reads the samples from the recording."""
        return self

    def failed(self, fault: str) -> CellResult:
        """Result with the reason why the task could not be done."""
        return CellResult(number=self.cell.number, fault=fault)

    def work(
        self, should_stop: Callable[[], bool], on_done: Callable[[int], None]
    ) -> CellResult | None:
        """Detect pulses in the cell; return None if stopped. `on_done` is called with numbers
        of searched samples.
        """
        cell, began_s = self.cell, time.process_time()
        pulses: list[Pulse] = []
        beeps: list[Beep] = []
        input_faults: list[str] = []
        place, lost, invalid, fault, gone = cell.lead_in, 0, 0, None, False
        try:
            with closing(self.recording.open()) as source:
                chain = _chain(self, source)
                radio = Receiver(source.center_frequency_hz, source.sample_rate_hz)
                search = BeepSearch(self.sought.tags, self.frequency_window_hz, radio)
                chain.on_band = search.add
                source.skip_to(place)
                try:
                    while place < cell.end:
                        if should_stop():
                            return None
                        block = source.read()
                        assert block is not None  # a file never makes one wait
                        # The last block is cut at the cell's end.
                        if place + len(block.samples) > cell.end:
                            block = replace(block, samples=block.samples[: cell.end - place])
                        # A gap in what is read again counts in the cell that it belongs to.
                        if cell.begin_ns is None or block.time_ns >= cell.begin_ns:
                            lost += block.lost_before
                        pulses += chain.process(block)
                        place += len(block.samples)
                        on_done(len(block.samples))
                    if place == source.total_samples:
                        source.read()  # raises the reason if the recording is incomplete
                except EOFError:
                    if place < cell.end:
                        fault = "it ended early: the file was changed during the search"
                except UavrtError as error:
                    fault, gone = str(error), _gone(self, error)
                pulses += chain.flush()
                beeps, input_faults = search.finish(), chain.input_faults
                invalid = source.invalid_values
        except UavrtError as error:
            fault, gone = str(error), _gone(self, error)
        return CellResult(
            number=cell.number,
            pulses=[] if gone else [one for one in pulses if _counts(cell, one)],
            beeps=[] if gone else beeps,
            input_faults=input_faults,
            lost_samples=lost,
            invalid_values=invalid,
            cpu_s=time.process_time() - began_s,
            searched=place > cell.lead_in,
            fault=fault,
            unreachable=gone,
        )


def keep_cell(directory: Path, result: CellResult) -> None:
    """Save a cell's result until its recording is finished. Raises `OSError`."""
    content = msgspec.msgpack.encode(result, enc_hook=_plain)
    write_note(directory / str(result.number), content)


def kept_cell(directory: Path, number: int) -> CellResult | None:
    """Read a cell's saved result; None if it is missing or damaged."""
    try:
        content = read_note(directory / str(number))
        result = msgspec.msgpack.decode(content, type=CellResult)
    except (OSError, FormatError, msgspec.DecodeError):
        return None
    return result if result.number == number else None


def _chain(task: CellTask, source: RecordingSource) -> DetectionChain:
    return DetectionChain(
        task.sought.tags,
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=source.center_frequency_hz,
        frequency_window_hz=task.frequency_window_hz,
        operating_modes=task.sought.operating_modes,
        excluded_hz=task.sought.excluded_hz,
    )


def _gone(task: CellTask, error: UavrtError) -> bool:
    """True if the samples are out of reach at present; False if lost, as on a bad disk."""
    if not out_of_reach(error):
        return False
    cause = error.__cause__
    if not isinstance(cause, OSError) or cause.errno != errno.EIO or task.recording.url:
        return True
    try:
        task.recording.path.stat()
    except OSError:
        return True
    return False


def _counts(cell: Cell, pulse: Pulse) -> bool:
    """False for a pulse that ends in the cell's lead-in, since the previous cell has it."""
    return cell.begin_ns is None or pulse.end_time_ns >= cell.begin_ns


def _plain(value: np.generic) -> object:
    return value.item()
