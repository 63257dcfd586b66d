"""Detect in one cell: chunk by chunk, each with its pulses and the state after it on disk."""

import errno
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np

from uavrt.analysis.measure import DetectionChain, TagSource
from uavrt.batch.cells import Cell
from uavrt.batch.chain_state import read_state, write_state
from uavrt.batch.recordings import Recording, out_of_reach
from uavrt.config import Receiver
from uavrt.detection.beeps import BeepSearch
from uavrt.errors import FormatError, UavrtError
from uavrt.messages import Beep, Pulse
from uavrt.radio import RecordingSource

STATE = "state"
DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class CellTask:
    """What a worker is asked to do."""

    recording: Recording
    cell: Cell
    sought: TagSource
    frequency_window_hz: float
    chunk_s: float
    directory: Path
    """For the cell's state and pulses."""

    def packed(self) -> "CellTask":
        """Give it as it is: the samples stay where they are."""
        return self

    def failed(self, fault: str) -> "CellResult":
        """Give a result when nothing could be done."""
        return CellResult(number=self.cell.number, fault=fault)

    def work(
        self, should_stop: Callable[[], bool], on_done: Callable[[int], None]
    ) -> "CellResult | None":
        """Detect in the cell; see `work_on`."""
        return work_on(self, should_stop=should_stop, on_samples=on_done)


class Chunk(msgspec.Struct, frozen=True, kw_only=True):
    """What a chunk gave."""

    first: int
    """Place of its first sample."""
    end: int
    lost_samples: int
    invalid_values: int
    cpu_s: float
    pulses: list[Pulse]
    beeps: list[Beep] = msgspec.field(default_factory=list)
    """What beeps, listed or not."""


class CellResult(msgspec.Struct, frozen=True, kw_only=True):
    """What a cell gave."""

    number: int
    chunks: list[int] = msgspec.field(default_factory=list)
    """The first places of its chunks: the names of their files."""
    fault: str | None = None
    """Why it ends early, or gave nothing."""
    unfinished: bool = False
    """What it has stays, and the next run goes on: the samples could not be reached."""


@dataclass(slots=True)
class _Gathered:
    pulses: list[Pulse] = field(default_factory=list)
    lost: int = 0
    invalid: int = 0


def work_on(
    task: CellTask,
    *,
    should_stop: Callable[[], bool] = lambda: False,
    on_samples: Callable[[int], None] = lambda _count: None,
) -> CellResult | None:
    """Detect in a cell, from where it was left.

    Parameters
    ----------
    task : CellTask
        The cell.
    should_stop : callable
        Asked at each block; True leaves the cell with its state written.
    on_samples : callable
        Takes how many samples were done since it was last called.

    Returns
    -------
    CellResult or None
        None: stopped before the end.

    Raises
    ------
    OSError
        The directory cannot be written.
    """
    task.directory.mkdir(parents=True, exist_ok=True)
    if (done := _done(task.directory)) is not None:
        on_samples(task.cell.end - task.cell.lead_in)
        return done
    fault = None
    try:
        with closing(task.recording.open()) as source:
            place, chain = _begin(task, source)
            on_samples(place - task.cell.lead_in)
            source.skip_to(place)
            while place < task.cell.end:
                place, fault = _chunk(task, source, chain, place, should_stop, on_samples)
                if fault is not None or (place < task.cell.end and should_stop()):
                    break
            if fault is None and place < task.cell.end:
                return None
    except UavrtError as error:
        fault = str(error)
        if _gone(task, error):
            return CellResult(number=task.cell.number, fault=fault, unfinished=True)
    result = CellResult(
        number=task.cell.number,
        chunks=sorted(int(path.stem) for path in task.directory.glob("[0-9]*.chunk")),
        fault=fault,
    )
    _write(task.directory / DONE, msgspec.msgpack.encode(result))
    (task.directory / STATE).unlink(missing_ok=True)
    return result


def read_chunks(directory: Path, result: CellResult) -> list[Chunk]:
    """Read the chunks of a cell that is done.

    Raises
    ------
    FormatError
        One is missing or damaged, or does not begin where the one before ends.
    """
    chunks: list[Chunk] = []
    for first in result.chunks:
        path = directory / f"{first}.chunk"
        try:
            chunks.append(msgspec.msgpack.decode(path.read_bytes(), type=Chunk))
        except (OSError, msgspec.DecodeError) as error:
            raise FormatError(
                f"{path} is damaged: {error}", remedy=f"Delete {directory}: it is done anew"
            ) from error
        if len(chunks) > 1 and chunks[-1].first != chunks[-2].end:
            raise FormatError(
                f"{path} does not begin where the chunk before it ends",
                remedy=f"Delete {directory}: it is done anew",
            )
    return chunks


def _begin(task: CellTask, source: RecordingSource) -> tuple[int, DetectionChain]:
    """Take up the state that was left, or make a new one."""
    path = task.directory / STATE
    try:
        left = read_state(path)
    except FormatError:
        left = None  # damaged by a full disk or made by another version: begin anew
    if left is not None and isinstance(left[1], DetectionChain):
        return left[0], left[1]
    for old in task.directory.glob("[0-9]*.chunk"):
        old.unlink()
    chain = DetectionChain(
        task.sought.tags,
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=source.center_frequency_hz,
        frequency_window_hz=task.frequency_window_hz,
        operating_modes=task.sought.operating_modes,
        excluded_hz=task.sought.excluded_hz,
    )
    return task.cell.lead_in, chain


def _chunk(
    task: CellTask,
    source: RecordingSource,
    chain: DetectionChain,
    first: int,
    should_stop: Callable[[], bool],
    on_samples: Callable[[int], None],
) -> tuple[int, str | None]:
    """Detect in one chunk and put it on the disk; where it ends, and what went wrong."""
    began_s, gathered, place, fault = time.process_time(), _Gathered(), first, None
    gone: UavrtError | None = None
    until = min(task.cell.end, first + round(task.chunk_s * source.sample_rate_hz))
    invalid = source.invalid_values
    radio = Receiver(source.center_frequency_hz, source.sample_rate_hz)
    search = BeepSearch(task.sought.tags, task.frequency_window_hz, radio)
    chain.on_band = search.add
    while place < until and not should_stop():
        try:
            block = source.read()
        except EOFError:
            fault = "it ended early: it was changed meanwhile"
            break
        except UavrtError as error:
            if _gone(task, error):
                gone = error
            else:
                fault = str(error)
            break
        assert block is not None  # a file never makes one wait
        # The blocks are the same whoever computes; the last one is cut at the cell's end.
        if place + len(block.samples) > task.cell.end:
            block = replace(block, samples=block.samples[: task.cell.end - place])
        # A gap in what is read again is counted in the cell whose own time it is of.
        if task.cell.begin_ns is None or block.time_ns >= task.cell.begin_ns:
            gathered.lost += block.lost_before
        gathered.pulses += chain.process(block)
        place += len(block.samples)
        on_samples(len(block.samples))
    if place == source.total_samples:
        fault = _fault_at_end(source)
    if fault is not None or place >= task.cell.end:
        gathered.pulses += chain.flush()
    chain.on_band = None
    kept = [one for one in gathered.pulses if _counts(task, one)]
    chunk = Chunk(
        first=first,
        end=place,
        lost_samples=gathered.lost,
        invalid_values=source.invalid_values - invalid,
        cpu_s=time.process_time() - began_s,
        pulses=kept,
        beeps=search.finish(),
    )
    if place > first or kept:
        encoded = msgspec.msgpack.encode(chunk, enc_hook=_plain)
        _write(task.directory / f"{first}.chunk", encoded)
        write_state(task.directory / STATE, place, chain)
    if gone is not None:
        raise gone
    return place, fault


def _gone(task: CellTask, error: UavrtError) -> bool:
    """Whether the samples cannot be reached now; a bad place on a disk stays as it is."""
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


def _fault_at_end(source: RecordingSource) -> str | None:
    """Why the recording is not whole, if it is not."""
    try:
        source.read()
    except EOFError:
        pass
    except UavrtError as error:
        return str(error)
    return None


def _counts(task: CellTask, pulse: Pulse) -> bool:
    """Whether a pulse is of the cell's own time, or so near to it that it may be."""
    begin_ns = task.cell.begin_ns
    return begin_ns is None or pulse.end_time_ns >= begin_ns


def _done(directory: Path) -> CellResult | None:
    try:
        result = msgspec.msgpack.decode((directory / DONE).read_bytes(), type=CellResult)
    except (OSError, msgspec.DecodeError):
        return None
    there = all((directory / f"{first}.chunk").is_file() for first in result.chunks)
    return result if there else None


def _plain(value: np.generic) -> object:
    """Turn a number of numpy's into one of Python's."""
    return value.item()


def _write(path: Path, data: bytes) -> None:
    """Replace a file, whole or not at all."""
    part = path.with_name(path.name + ".part")
    part.write_bytes(data)
    part.replace(path)
