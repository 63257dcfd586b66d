"""The second half of a batch: poses, bearings and positions of each flight."""

import hashlib
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import uavrt
from uavrt.analysis.measure import TagSource
from uavrt.batch.flight_work import FlightResult, FlightTask, Searched
from uavrt.batch.ledger import Ledger
from uavrt.batch.recordings import Found, Recording, flight_of
from uavrt.batch.settings import BatchSettings
from uavrt.batch.tables import (
    BEARINGS,
    INTEGRATED,
    POSES,
    POSITIONS,
    PULSES,
    BearingOfTag,
    FlightRow,
    PoseRow,
    PositionOfTag,
    RecordingRow,
    folder_of,
    write_pulses,
    write_rows,
)
from uavrt.clock import Clock
from uavrt.recording import FlightLayout, IntegratedVerdict

R = TypeVar("R")


class Placing:
    """Which flights are to be placed, and what becomes of them.

    Parameters
    ----------
    sought : TagSource
        The tags.
    output : Path
        Directory of the tables.
    settings : BatchSettings
        How.
    recordings, flights : Ledger
        What is done.
    """

    def __init__(
        self,
        sought: TagSource,
        output: Path,
        settings: BatchSettings,
        recordings: Ledger[RecordingRow],
        flights: Ledger[FlightRow],
    ) -> None:
        self._sought, self._output, self._settings = sought, output, settings
        self._recordings, self._flights = recordings, flights
        self.tasks: list[FlightTask] = []
        self._copies: dict[str, set[str]] = {}
        self.kept: dict[str, str] = {}
        """Flights that cannot be reached now, with the reason: what was done of them stays."""
        self.done_before = 0

    def plan(
        self,
        found: Found,
        keys: Mapping[Path, str],
        names: Mapping[Path, str],
        copies: Mapping[Path, Path],
    ) -> None:
        """Add all flights, and recordings with a track, that are not done yet.

        Parameters
        ----------
        found : Found
            What there is.
        keys : mapping of Path to str
            Of the recordings, as the ledger knows them.
        names : mapping of Path to str
            Of the flights, by directory.
        copies : mapping of Path to Path
            The flight that counts, by directory of each copy.
        """
        if "attach" not in self._settings.steps:
            return
        for copy, directory in copies.items():
            self._note_copy(str(copy), str(directory))
        of_flight: dict[Path, list[Searched]] = defaultdict(list)
        for recording in found.recordings:
            row = self._recordings.done(keys.get(recording.path, ""))
            if row is None:
                continue
            searched = self._searched(row)
            if recording.flight_directory is not None:
                of_flight[recording.flight_directory].append(searched)
            elif recording.track is not None:
                self._add(recording.name, row.flight, [searched], recording)
        for directory, row in self._taken_away(found):
            of_flight[directory].append(self._searched(row))
        for directory in found.flights:
            self._add(str(directory), names[directory], of_flight[directory], None)

    def _note_copy(self, copy: str, path: str) -> None:
        row = self._flights.of(path)
        known = () if row is None else row.copies.splitlines()
        noted = self._copies.setdefault(path, {*known})
        noted.add(copy)
        if row is not None and noted != {*known}:
            self._flights.settle(replace(row, copies="\n".join(sorted(noted))))

    def _searched(self, row: RecordingRow) -> Searched:
        file = self._output / PULSES / folder_of(row.flight) / f"{row.fingerprint}.parquet"
        return Searched(recording=row.path, file=file)

    def _taken_away(self, found: Found) -> Iterator[tuple[Path, RecordingRow]]:
        """Recordings of flights that were searched and are there no more: their pulses are."""
        flights, there = set(found.flights), {one.name for one in found.recordings}
        for row in self._recordings.rows:
            if row.state in ("done", "truncated") and row.path not in there:
                flight = flight_of(row.path, flights)
                if flight is not None:
                    yield flight, row

    def _add(
        self, path: str, flight: str, searched: list[Searched], recording: Recording | None
    ) -> None:
        settings = self._settings
        task = FlightTask(
            path=path,
            flight=flight,
            key="",
            is_flight=recording is None,
            searched=tuple(searched),
            tags=self._sought.tags,
            track=None if recording is None else recording.track,
            clock_offset_s=None if recording is None else recording.clock_offset_s,
            steps=tuple(step for step in settings.steps if step != "detect"),
            settings=settings.placing,
        )
        try:
            task = replace(task, key=_key(task))
        except OSError as error:
            self._kept_or_failed(task, FlightResult(fault=str(error), failed=True, gone=True))
            return
        if self._flights.done(task.key) is None:
            self.tasks.append(task)
        else:
            self.done_before += 1

    def finish(self, number: int, result: FlightResult) -> FlightRow | None:
        """Write what a flight gave, and what was done with it; None: what was before stays."""
        task = self.tasks[number]
        return self._kept_or_failed(task, result) if result.failed else self._done(task, result)

    def _kept_or_failed(self, task: FlightTask, result: FlightResult) -> FlightRow | None:
        if result.gone and self._flights.of(task.path) is not None:
            self.kept[task.path] = result.fault or ""
            return None
        return self._settled(_row(task, result))

    def _settled(self, row: FlightRow) -> FlightRow:
        copies = self._copies.get(row.path, ())
        row = replace(row, copies="\n".join(sorted(copies)))
        self._flights.settle(row)
        return row

    def _done(self, task: FlightTask, result: FlightResult) -> FlightRow:
        if task.is_flight:
            self._settle_recorded(task, result)
        self._write(task, POSES, PoseRow, result.poses)
        self._write(task, BEARINGS, BearingOfTag, result.bearings)
        self._write(task, POSITIONS, PositionOfTag, result.positions)
        self._write(task, INTEGRATED, IntegratedVerdict, result.integrated)
        return self._settled(_row(task, result))

    def _write(
        self, task: FlightTask, table: str, record: type[R], rows: tuple[R, ...]
    ) -> None:
        if rows:
            file = self._output / table / folder_of(task.flight) / f"{task.key}.parquet"
            write_rows(file, record, rows)

    def _settle_recorded(self, task: FlightTask, result: FlightResult) -> None:
        """Keep the pulses that a flight found itself, unless its recordings were searched."""
        if result.recorded is None:
            self._recordings.drop(task.path)
            return
        key = _recorded_key(task)
        if self._recordings.done(key) is not None:
            return
        file = self._output / PULSES / folder_of(task.flight) / f"{key}.parquet"
        write_pulses(file, [(0, pulse) for pulse in result.recorded], task.path)
        self._recordings.settle(
            RecordingRow(
                path=task.path,
                flight=task.flight,
                fingerprint=key,
                state="recorded",
                fault=None,
                start_time_ns=result.start_time_ns,
                length_s=0.0,
                sample_rate_hz=None,
                center_frequency_hz=None,
                pulses=len(result.recorded),
                confirmed=sum(pulse.confirmed for pulse in result.recorded),
                lost_samples=0,
                invalid_values=0,
                cells=0,
                cpu_s=0.0,
                finished_time_ns=Clock.start().now_ns(),
                uavrt_version=uavrt.__version__,
            )
        )


def _row(task: FlightTask, result: FlightResult) -> FlightRow:
    return FlightRow(
        path=task.path,
        flight=task.flight,
        fingerprint=task.key,
        state="failed" if result.failed else "done",
        fault=result.fault,
        start_time_ns=result.start_time_ns,
        steps=",".join(task.steps),
        antenna=result.antenna,
        dem=task.settings.dem,
        pulses=result.pulses,
        pulses_with_pose=len(result.poses),
        clock_offset_s=result.clock_offset_s,
        bearings=len(result.bearings),
        positions=len(result.positions),
        cpu_s=result.cpu_s,
        finished_time_ns=Clock.start().now_ns(),
        uavrt_version=uavrt.__version__,
    )


def _key(task: FlightTask) -> str:
    """Name a flight as it is, with its pulses, under these settings."""
    facts: list[object] = [
        *(task.path, [one.file.stem for one in task.searched], sorted(map(repr, task.tags))),
        *(task.steps, task.clock_offset_s, repr(task.settings), uavrt.__version__),
    ]
    kept: list[Path] = []
    if "integrate" in task.steps and task.is_flight:
        kept = sorted(FlightLayout(Path(task.path)).channels_directory.glob("*.sigmf-*"))
    ground: list[Path] = []
    if task.settings.dem is not None:
        dem = Path(task.settings.dem)
        ground = sorted(dem.iterdir()) if dem.is_dir() else [dem]
    asked = task.settings.antenna
    antenna = [] if asked is None else [Path(asked)]
    return _hashed(facts, [*_files(task), *antenna, *ground, *kept])


def _recorded_key(task: FlightTask) -> str:
    """Name the pulses of a flight as it is."""
    return _hashed([task.path], _files(task))


def _files(task: FlightTask) -> list[Path]:
    layout = FlightLayout(Path(task.path))
    track = [] if task.track is None else [task.track]
    return [layout.database, layout.write_ahead_log, *track]


def _hashed(facts: list[object], files: list[Path]) -> str:
    for path in files:
        # To read a database leaves an empty write-ahead log beside it.
        if path.is_file() and (about := path.stat()).st_size:
            facts += [str(path), about.st_size, about.st_mtime_ns]
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]
