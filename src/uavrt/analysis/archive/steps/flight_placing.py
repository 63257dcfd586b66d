"""Second half of a batch: compute poses, bearings and positions of each flight."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import uavrt
from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.parquet_tables import (
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
    write_pulses,
    write_rows,
)
from uavrt.analysis.archive.parquet.seals import FileFingerprint
from uavrt.analysis.archive.recordings import Found, Recording, flight_of
from uavrt.analysis.archive.steps.batch_settings import STEPS, BatchSettings
from uavrt.analysis.archive.steps.flight_work import FlightResult, FlightTask, Searched
from uavrt.analysis.archive.steps.remedies import by_manifest
from uavrt.analysis.archive.steps.step_keys import (
    PLACING_STEPS,
    key_of,
    read_keys,
    recorded_key,
    step_keys,
    written,
)
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.clock import Clock
from uavrt.flight.integrated import IntegratedVerdict
from uavrt.localization.antenna import MONOPOLE

R = TypeVar("R")
TABLE_OF = {"bearing": BEARINGS, "localize": POSITIONS, "integrate": INTEGRATED}
"""Output table of each step whose results can be kept while other steps run again."""


class Placing:
    """Plans one task for each flight to estimate, and stores the results."""

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
        self._plans: list[_Plan] = []
        self._copies: dict[str, set[str]] = {}
        self.kept: dict[str, str] = {}
        """Why a flight is not reachable now, by its name; its earlier results stay."""
        self.done_before = 0

    def plan(self, found: Found, keys: Mapping[Path, str], copies: Mapping[Path, Path]) -> None:
        """Add tasks for all unfinished flights, and for recordings that have a track."""
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
        for directory, name in found.flights.items():
            self._add(str(directory), name, of_flight[directory], None)

    def _note_copy(self, copy: str, path: str) -> None:
        row = self._flights.of(path)
        known = () if row is None else row.copies.splitlines()
        noted = self._copies.setdefault(path, {*known})
        noted.add(copy)
        if row is not None and noted != {*known}:
            self._flights.record(replace(row, copies="\n".join(sorted(noted))))

    def _searched(self, row: RecordingRow) -> Searched:
        file = self._output / PULSES / f"{row.fingerprint}.parquet"
        return Searched(recording=row.path, file=file)

    def _taken_away(self, found: Found) -> Iterator[tuple[Path, RecordingRow]]:
        """Flight directory and row of each deleted recording whose pulses are still stored."""
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
            searched=tuple(sorted(searched, key=lambda one: one.recording)),
            tags=self._sought.tags,
            track=None if recording is None else recording.track,
            clock_offset_s=None if recording is None else recording.clock_offset_s,
            vehicle=None if recording is None else recording.vehicle,
            steps=tuple(step for step in STEPS if step in settings.steps and step != "detect"),
            settings=settings.placing,
        )
        try:
            # Of its own pulses nothing may be left: they are read again.
            lost = task.is_flight and not searched and not self._recorded(task)
            planned = _planned(task, self._flights.of(path), again=lost)
        except OSError as error:
            self._kept_or_failed(task, FlightResult(fault=str(error), failed=True, gone=True))
            return
        if planned is None:
            self.done_before += 1
        else:
            self.tasks.append(planned.task)
            self._plans.append(planned)

    def _recorded(self, task: FlightTask) -> bool:
        return self._recordings.done(recorded_key(task)) is not None

    def finish(self, number: int, result: FlightResult) -> FlightRow | None:
        """Store a flight's results; return its row, or None if its earlier results are kept."""
        plan = self._plans[number]
        if result.failed:
            return self._kept_or_failed(plan.task, result)
        return self._done(plan, result)

    def _kept_or_failed(self, task: FlightTask, result: FlightResult) -> FlightRow | None:
        if result.gone and self._flights.of(task.path) is not None:
            self.kept[task.path] = result.fault or ""
            return None
        failed = replace(task, key=key_of(task.path, {}))
        return self._settled(_row(failed, result), {})

    def _settled(self, row: FlightRow, files: Mapping[str, FileFingerprint]) -> FlightRow:
        copies = self._copies.get(row.path, ())
        row = replace(row, copies="\n".join(sorted(copies)))
        self._flights.record(row, files)
        return row

    def _done(self, plan: "_Plan", result: FlightResult) -> FlightRow:
        keys = plan.keys_with(result.antenna)
        task = replace(plan.task, key=key_of(plan.task.path, keys))
        if task.is_flight:
            self._settle_recorded(task, result)
        row, files = _row(task, result), dict[str, FileFingerprint]()
        if (before := plan.before) is not None:
            tables = {TABLE_OF[step] for step in plan.kept}
            kept = self._flights.files(before.fingerprint)
            files = {name: one for name, one in kept.items() if name.split("/")[0] in tables}
            row = _with_kept(row, before, plan.kept)
        files |= self._write(task, POSES, PoseRow, result.poses)
        files |= self._write(task, BEARINGS, BearingOfTag, result.bearings)
        files |= self._write(task, POSITIONS, PositionOfTag, result.positions)
        files |= self._write(task, INTEGRATED, IntegratedVerdict, result.integrated)
        steps = ",".join(step for step in STEPS if step in keys)
        return self._settled(replace(row, steps=steps, fingerprints=written(keys)), files)

    def _write(
        self, task: FlightTask, table: str, record: type[R], rows: tuple[R, ...]
    ) -> dict[str, FileFingerprint]:
        if not rows:
            return {}
        name = f"{table}/{task.key}.parquet"
        return {name: write_rows(self._output / name, record, rows, task.flight)}

    def _settle_recorded(self, task: FlightTask, result: FlightResult) -> None:
        """Store the pulses detected in flight, or remove them if a recording was searched."""
        if result.recorded is None:
            self._recordings.drop(task.path)
            return
        key = recorded_key(task)
        if self._recordings.done(key) is not None:
            return
        name = f"{PULSES}/{key}.parquet"
        pulses = [(0, pulse) for pulse in result.recorded]
        seal = write_pulses(self._output / name, pulses, task.path, task.flight)
        self._recordings.record(
            RecordingRow(
                path=task.path,
                flight=task.flight,
                fingerprint=key,
                state="recorded",
                start_time_ns=result.start_time_ns,
                pulses=len(result.recorded),
                confirmed=sum(pulse.confirmed for pulse in result.recorded),
                finished_time_ns=Clock.start().now_ns(),
                uavrt_version=uavrt.__version__,
            ),
            {name: seal},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plan:
    """Steps of a flight that must run, and steps whose earlier results are kept."""

    task: FlightTask
    keys: Mapping[str, str]
    """Hash of each step's inputs, by name of the step, if the antenna is directional."""
    whip_keys: Mapping[str, str]
    before: FlightRow | None
    kept: tuple[str, ...]

    def keys_with(self, antenna: str) -> dict[str, str]:
        """Hash of each step's inputs, by name of the step, for the antenna that was used."""
        keys = self.whip_keys if antenna == MONOPOLE else self.keys
        return {step: keys[step] for step in (*self.task.steps, *self.kept)}


def _planned(
    task: FlightTask, before: FlightRow | None, *, again: bool = False
) -> _Plan | None:
    """Plan a flight's steps with changed inputs; None if all results are up to date."""
    keys, whip_keys = step_keys(task)
    done = {} if before is None else read_keys(before.fingerprints)
    antenna = task.settings.antenna or (before.antenna if before is not None else "")
    now = whip_keys if antenna == MONOPOLE else keys
    stale = {step for step in task.steps if done.get(step) != now[step]} | (
        {"attach"} if again else set()
    )
    if not stale:
        return None
    asked = set(task.steps)
    doing = {"attach"} | (stale & {"integrate"})
    if stale & set(PLACING_STEPS):
        doing |= asked & set(PLACING_STEPS)
    return _Plan(
        task=replace(task, steps=tuple(step for step in task.steps if step in doing)),
        keys=keys,
        whip_keys=whip_keys,
        before=before,
        kept=tuple(step for step in done if step not in doing and done[step] == now[step]),
    )


def _with_kept(row: FlightRow, before: FlightRow, kept: Collection[str]) -> FlightRow:
    if "bearing" in kept:
        row = replace(row, fault=before.fault, bearings=before.bearings)
    if "localize" in kept:
        row = replace(row, positions=before.positions)
    if "integrate" in kept:
        row = replace(row, integrate_fault=before.integrate_fault)
    return row


def _row(task: FlightTask, result: FlightResult) -> FlightRow:
    return FlightRow(
        path=task.path,
        flight=task.flight,
        fingerprint=task.key,
        state="failed" if result.failed else "done",
        fault=None if result.fault is None else by_manifest(result.fault),
        integrate_fault=result.integrate_fault,
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
