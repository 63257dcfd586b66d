"""First half of a batch: detect the pulses of each recording, cell by cell."""

import hashlib
import shutil
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path

import uavrt
from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.parquet_tables import PULSES, RecordingRow, write_pulses
from uavrt.analysis.archive.recordings import Recording, out_of_reach
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.archive.steps.cell_work import CellResult, CellTask, keep_cell, kept_cell
from uavrt.analysis.archive.steps.recording_cells import cells_of
from uavrt.analysis.archive.steps.remedies import by_manifest
from uavrt.analysis.archive.steps.step_keys import tags_as_read
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.config.tags.tag_corrections import words_of_beeps
from uavrt.core.clock import Clock
from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Beep, Pulse, keep_beep

log = get_logger()

UNFINISHED = "unfinished"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Facts:
    """Metadata of a recording; all fields are empty if the recording cannot be opened."""

    start_time_ns: int | None = None
    length_s: float | None = None
    sample_rate_hz: float | None = None
    center_frequency_hz: float | None = None
    tags_outside: tuple[int, ...] = ()


@dataclass(slots=True)
class _Job:
    recording: Recording
    key: str
    facts: _Facts
    cells: int = 0
    results: list[CellResult] = field(default_factory=list)


class Detecting:
    """Plans detection for recordings without a row in `ledger`, and combines the results."""

    def __init__(
        self,
        sought: TagSource,
        output: Path,
        settings: BatchSettings,
        ledger: Ledger[RecordingRow],
    ) -> None:
        self._sought, self._output = sought, output
        self._settings, self._ledger = settings, ledger
        for kept in (output / UNFINISHED).glob("*/"):
            if ledger.done(kept.name) is not None:  # a cut came before they were removed
                shutil.rmtree(kept)
        self._jobs: list[_Job] = []
        self.keys: dict[Path, str] = {}
        """Hash of content, tags and settings of each recording that can be opened, by path."""
        self.kept: dict[str, str] = {}
        """Why a recording is not reachable now, by its name; its earlier results stay."""
        self.done_before = 0
        self.tasks: list[CellTask] = []
        self.dated_by_file: dict[str, str] = {}
        """Warning, by name, for each recording whose start is taken from its file's time."""

    def plan(self, recording: Recording) -> RecordingRow | None:
        """Add a recording's detection tasks; if it needs none, return its new row, if any."""
        try:
            key = _key(recording, self._sought, self._settings)
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
            log.exception("unreadable recording skipped", recording=recording.name)
            return self._failed(recording, f"{type(error).__name__}: {error}")
        return self._finished(job) if len(job.results) == job.cells else None

    def _failed(
        self, recording: Recording, fault: str, *, gone: bool = False
    ) -> RecordingRow | None:
        if gone and self._take_known(recording):
            self.kept[recording.name] = by_manifest(fault)
            return None
        key = hashlib.sha256(recording.name.encode()).hexdigest()[:16]
        row = _row(_Job(recording, key, _Facts()), "failed", [fault])
        self._ledger.record(row)
        return row

    def _take_known(self, recording: Recording) -> bool:
        """Use the last results of a recording that is not searched in this run; return False if
        there are none.
        """
        known = self._ledger.of(recording.name)
        if known is not None:
            self.keys[recording.path] = known.fingerprint
        return known is not None

    def finish(self, number: int, result: CellResult) -> RecordingRow | None:
        """Add one task's result; return the recording's row if it was the last task."""
        job = self._jobs[number]
        job.results.append(result)
        if len(job.results) < job.cells:
            if not result.unreachable:
                keep_cell(self._kept_cells(job.key), result)
            return None
        return self._finished(job)

    def _finished(self, job: _Job) -> RecordingRow | None:
        if gone := [one.fault or "" for one in job.results if one.unreachable]:
            if self._take_known(job.recording):
                self.kept[job.recording.name] = by_manifest(gone[0])
                return None
            row = _row(job, "failed", gone)
            self._ledger.record(row)
            return row
        job.results.sort(key=lambda one: one.number)
        faults = [one.fault for one in job.results if one.fault is not None]
        searched = any(one.searched for one in job.results)
        state = "done" if not faults else "truncated" if searched else "failed"
        pulses = _joined(job.results)
        row = _row(job, state, faults, [pulse for _, pulse in pulses])
        files = {}
        if state != "failed":
            name, recording = f"{PULSES}/{job.key}.parquet", job.recording
            files[name] = write_pulses(
                self._output / name, pulses, recording.name, recording.flight
            )
        self._ledger.record(row, files)
        shutil.rmtree(self._kept_cells(job.key), ignore_errors=True)
        return row

    def _kept_cells(self, key: str) -> Path:
        return self._output / UNFINISHED / key

    def _planned(self, recording: Recording, key: str) -> _Job:
        settings = self._settings
        with closing(recording.open()) as source:
            rate_hz, center_hz = source.sample_rate_hz, source.center_frequency_hz
            if source.dated_by_file:
                self.dated_by_file[recording.name] = by_manifest(source.origin)
            cells = cells_of(
                source.segments, rate_hz, cell_s=settings.cell_s, lead_in_s=settings.lead_in_s
            )
            sought = self._sought.within(rate_hz, center_hz)
            facts = _Facts(
                start_time_ns=source.start_time_ns,
                length_s=(source.total_samples or 0) / rate_hz,
                sample_rate_hz=rate_hz,
                center_frequency_hz=center_hz,
                tags_outside=tuple(
                    tag.tag_id for tag in self._sought.tags if tag not in sought.tags
                ),
            )
        job = _Job(recording, key, facts, len(cells))
        for cell in cells:
            if (kept := kept_cell(self._kept_cells(key), cell.number)) is not None:
                job.results.append(kept)
                continue
            self._jobs.append(job)
            self.tasks.append(
                CellTask(
                    recording=recording,
                    cell=cell,
                    sought=sought,
                    frequency_window_hz=settings.frequency_window_hz,
                )
            )
        return job


def _key(recording: Recording, sought: TagSource, settings: BatchSettings) -> str:
    facts = (
        recording.fingerprint(),
        tags_as_read(sought.tags),
        sorted((number, mode.value) for number, mode in sought.operating_modes.items()),
        sought.excluded_hz,
        settings.frequency_window_hz,
        settings.cell_s,
        settings.lead_in_s,
        uavrt.__version__,
    )
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


def _row(
    job: _Job, state: str, faults: Sequence[str], pulses: Sequence[Pulse] = ()
) -> RecordingRow:
    return RecordingRow(
        path=job.recording.name,
        flight=job.recording.flight,
        fingerprint=job.key,
        state=state,
        fault=by_manifest("; ".join(dict.fromkeys(faults))) or None,
        **asdict(job.facts),
        pulses=len(pulses),
        confirmed=sum(pulse.confirmed for pulse in pulses),
        lost_samples=sum(one.lost_samples for one in job.results),
        invalid_values=sum(one.invalid_values for one in job.results),
        cells=job.cells,
        cpu_s=sum(one.cpu_s for one in job.results),
        finished_time_ns=Clock.start().now_ns(),
        uavrt_version=uavrt.__version__,
        beeps="\n".join(words_of_beeps(_beeps(job.results))),
        input_faults="\n".join(
            dict.fromkeys(fault for one in job.results for fault in one.input_faults)
        ),
    )


def _beeps(results: Sequence[CellResult]) -> list[Beep]:
    found: list[Beep] = []
    for one in results:
        for beep in one.beeps:
            keep_beep(found, beep)
    return found


def _joined(results: Sequence[CellResult]) -> list[tuple[int, Pulse]]:
    """Pulses of a recording's cells by tag and time; one found in two cells counts once."""
    found = [(one.number, pulse) for one in results for pulse in one.pulses]
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
