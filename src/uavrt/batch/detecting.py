"""The first half of a batch: pulses of each recording, cell by cell."""

import hashlib
import shutil
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import uavrt
from uavrt.analysis.measure import TagSource
from uavrt.batch.cell_work import CellResult, CellTask, Chunk, read_chunks
from uavrt.batch.cells import cells_of
from uavrt.batch.ledger import Ledger
from uavrt.batch.recordings import Recording, out_of_reach
from uavrt.batch.remedies import by_manifest
from uavrt.batch.settings import BatchSettings
from uavrt.batch.step_keys import tags_as_read
from uavrt.batch.tables import PULSES, RecordingRow, folder_of, write_pulses
from uavrt.clock import Clock
from uavrt.errors import FormatError, UavrtError
from uavrt.log import get_logger
from uavrt.messages import Beep, Pulse, keep_beep

log = get_logger()

UNFINISHED = "unfinished"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Facts:
    """What a recording says of itself; nothing when it cannot be opened."""

    start_time_ns: int | None = None
    length_s: float = 0.0
    sample_rate_hz: float | None = None
    center_frequency_hz: float | None = None


@dataclass(slots=True)
class _Job:
    recording: Recording
    key: str
    tasks: list[CellTask]
    results: list[CellResult]
    facts: _Facts


class Detecting:
    """What is to be detected, and what becomes of it.

    Parameters
    ----------
    sought : TagSource
        The tags.
    output : Path
        Directory of the tables.
    settings : BatchSettings
        How.
    ledger : Ledger of RecordingRow
        What is done.
    """

    def __init__(
        self,
        sought: TagSource,
        output: Path,
        settings: BatchSettings,
        ledger: Ledger[RecordingRow],
    ) -> None:
        self._sought, self._output = sought, output
        self._settings, self._ledger = settings, ledger
        self._jobs: list[_Job] = []
        """Of each task."""
        self.keys: dict[Path, str] = {}
        """Of recordings that can be opened, by path."""
        self.kept: dict[str, str] = {}
        """Recordings that cannot be reached now, and why: what was done of them stays."""
        self.done_before = 0
        self.tasks: list[CellTask] = []
        self.dated_by_file: dict[str, str] = {}
        """Recordings that begin by the date of their file alone, with what is said of that."""

    def plan(self, recording: Recording) -> RecordingRow | None:
        """Add what is to be done with a recording; a row when nothing can be."""
        try:
            key = self._key(recording)
            self.keys[recording.path] = key
            if self._ledger.done(key) is not None:
                self.done_before += 1
                return None
            if "detect" not in self._settings.steps:
                self._take_known(recording)
                return None
            job = self._planned(recording, key)
        except (UavrtError, OSError) as error:
            return self._failed(recording, str(error), gone=out_of_reach(error))
        except Exception as error:  # no file ends the run of an archive
            log.exception("a recording cannot be read", recording=recording.name)
            return self._failed(recording, f"{type(error).__name__}: {error}")
        self.tasks += job.tasks
        self._jobs += [job] * len(job.tasks)
        return None

    def _key(self, recording: Recording) -> str:
        key = _key(recording, tags_as_read(self._sought.tags), self._sought, self._settings)
        if self._ledger.done(key) is None:
            # Keys once held the names of tags, too.
            named = sorted(map(repr, self._sought.tags))
            before = _key(recording, named, self._sought, self._settings)
            if (row := self._ledger.done(before)) is not None:
                self._ledger.rekey(row, key)
        return key

    def _failed(
        self, recording: Recording, fault: str, *, gone: bool = False
    ) -> RecordingRow | None:
        if gone and self._take_known(recording):
            self.kept[recording.name] = by_manifest(fault)
            return None
        key = hashlib.sha256(recording.name.encode()).hexdigest()[:16]
        row = _row(_Job(recording, key, [], [], _Facts()), "failed", [fault])
        self._ledger.settle(row)
        return row

    def _take_known(self, recording: Recording) -> bool:
        """Go by what was done of a recording before, under whatever settings, if anything."""
        known = self._ledger.of(recording.name)
        if known is not None:
            self.keys[recording.path] = known.fingerprint
        return known is not None

    def finish(self, number: int, result: CellResult) -> RecordingRow | None:
        """Take a task's result; a row when it was a recording's last, and it has one of it."""
        job = self._jobs[number]
        job.results.append(result)
        if len(job.results) < len(job.tasks):
            return None
        if gone := [one.fault or "" for one in job.results if one.unfinished]:
            if self._take_known(job.recording):
                self.kept[job.recording.name] = by_manifest(gone[0])
                return None
            row = _row(job, "failed", gone)
            self._ledger.settle(row)
            return row
        chunks, faults = _gathered(job, self._output)
        pulses = _joined(chunks)
        state = "done" if not faults else "truncated" if chunks else "failed"
        if state != "failed":
            folder = self._output / PULSES / folder_of(job.recording.flight)
            write_pulses(folder / f"{job.key}.parquet", pulses, job.recording.name)
        only = [chunk for _, chunk in chunks]
        row = _row(job, state, faults, only, [pulse for _, pulse in pulses])
        self._ledger.settle(row)
        shutil.rmtree(self._output / UNFINISHED / job.key, ignore_errors=True)
        return row

    def _planned(self, recording: Recording, key: str) -> _Job:
        settings = self._settings
        with closing(recording.open()) as source:
            rate_hz = source.sample_rate_hz
            if source.dated_by_file:
                self.dated_by_file[recording.name] = by_manifest(source.origin)
            cells = cells_of(
                source.segments, rate_hz, cell_s=settings.cell_s, lead_in_s=settings.lead_in_s
            )
            facts = _Facts(
                start_time_ns=source.start_time_ns,
                length_s=(source.total_samples or 0) / rate_hz,
                sample_rate_hz=rate_hz,
                center_frequency_hz=source.center_frequency_hz,
            )
        tasks = [
            CellTask(
                recording=recording,
                cell=cell,
                sought=self._sought,
                frequency_window_hz=settings.frequency_window_hz,
                chunk_s=settings.chunk_s,
                directory=self._output / UNFINISHED / key / str(cell.number),
            )
            for cell in cells
        ]
        return _Job(recording, key, tasks, [], facts)


def _key(
    recording: Recording, tags: list[str], sought: TagSource, settings: BatchSettings
) -> str:
    """Name a recording as it is under these tags and settings."""
    facts = (
        recording.fingerprint(),
        tags,
        sorted((number, mode.value) for number, mode in sought.operating_modes.items()),
        sought.excluded_hz,
        settings.frequency_window_hz,
        settings.cell_s,
        settings.lead_in_s,
        uavrt.__version__,
    )
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


def _gathered(job: _Job, output: Path) -> tuple[list[tuple[int, Chunk]], list[str]]:
    """What its cells gave, each chunk with its cell's number; and what went wrong."""
    chunks: list[tuple[int, Chunk]] = []
    faults = []
    for result in sorted(job.results, key=lambda one: one.number):
        directory = output / UNFINISHED / job.key / str(result.number)
        try:
            chunks += [(result.number, chunk) for chunk in read_chunks(directory, result)]
        except FormatError as error:
            faults.append(str(error))
        if result.fault is not None:
            faults.append(result.fault)
    return chunks, faults


def _row(
    job: _Job,
    state: str,
    faults: Sequence[str],
    chunks: Sequence[Chunk] = (),
    pulses: Sequence[Pulse] = (),
) -> RecordingRow:
    return RecordingRow(
        path=job.recording.name,
        flight=job.recording.flight,
        fingerprint=job.key,
        state=state,
        fault=by_manifest("; ".join(dict.fromkeys(faults))) or None,
        start_time_ns=job.facts.start_time_ns,
        length_s=job.facts.length_s,
        sample_rate_hz=job.facts.sample_rate_hz,
        center_frequency_hz=job.facts.center_frequency_hz,
        pulses=len(pulses),
        confirmed=sum(pulse.confirmed for pulse in pulses),
        lost_samples=sum(chunk.lost_samples for chunk in chunks),
        invalid_values=sum(chunk.invalid_values for chunk in chunks),
        cells=len(job.tasks),
        cpu_s=sum(chunk.cpu_s for chunk in chunks),
        finished_time_ns=Clock.start().now_ns(),
        uavrt_version=uavrt.__version__,
        beeps="\n".join(str(one) for one in _beeps(chunks) if one.odd),
    )


def _beeps(chunks: Sequence[Chunk]) -> list[Beep]:
    """What beeps in a recording, each sender once."""
    found: list[Beep] = []
    for chunk in chunks:
        for beep in chunk.beeps:
            keep_beep(found, beep)
    return found


def _joined(chunks: Sequence[tuple[int, Chunk]]) -> list[tuple[int, Pulse]]:
    """Join cells in the order of time; a pulse on the line between two is in both."""
    found = [(number, pulse) for number, chunk in chunks for pulse in chunk.pulses]
    found.sort(key=lambda one: (one[1].tag_id, one[1].start_time_ns))
    kept: list[tuple[int, Pulse]] = []
    for number, pulse in found:
        if kept:
            last_number, last = kept[-1]
            same = last.tag_id == pulse.tag_id and last_number != number
            if same and pulse.start_time_ns < last.end_time_ns:
                continue
        kept.append((number, pulse))
    return sorted(kept, key=lambda one: (one[1].start_time_ns, one[1].tag_id))
