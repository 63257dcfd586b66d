"""``uavrt batch``: find the pulses of one tag list in a whole archive of recordings."""

# isort: off
from uavrt.cli.shown.notices import notice
from uavrt.cli.options.kinds import Between, Hertz
import uavrt.cli.shown.one_thread  # noqa: F401  before numpy

# isort: on
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, NoReturn

from cyclopts import Parameter

from uavrt.cli.options.placing_options import USUAL_PLACING, Placing
from uavrt.core.errors import UsageError
from uavrt.core.units import counted

if TYPE_CHECKING:
    from uavrt.analysis.archive.parquet.parquet_tables import FlightRow, RecordingRow
    from uavrt.analysis.archive.recordings import Found
    from uavrt.analysis.archive.steps.batch_settings import BatchSummary

Stretch = Annotated[float, Parameter(validator=Between(least=60, most=1e6, unit="s"))]
_STOPPED = "stopped; the same command continues from here"
_END_S = 0.5
"""Time to end cleanly after Ctrl-C [s]; after twice this time the process is ended by force."""
LeadIn = Annotated[float, Parameter(validator=Between(least=0, most=3600, unit="s"))]


def batch(
    paths: list[str],
    *,
    tags: Path,
    output: Annotated[Path, Parameter(alias="-o")],
    manifest: Path | None = None,
    frequency_window: Hertz = 500.0,
    workers: Annotated[int, Parameter(validator=Between(least=1, most=256))] | None = None,
    scheduler: str | None = None,
    cell: Stretch = 3600.0,
    lead_in: LeadIn = 120.0,
    steps: Annotated[
        list[str] | None, Parameter(name="--step", consume_multiple=True, negative="")
    ] = None,
    method: str = "bayes",
    place: Placing = USUAL_PLACING,
    verify: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Find the pulses of tags in all recordings of an archive, and where the tags were.

    Detects in all recordings; adds poses from the flight that contains the recording, or from a
    track with the same name; estimates bearings and positions as uavrt localize does. A flight
    without a recording gives its pulses as detected in flight. Writes Parquet tables for uavrt
    archive and for any program that reads Parquet. A run that was stopped or killed continues
    where it was; only new or changed recordings, tags and settings are computed again. Damaged
    files are reported and skipped, and the exit status is then 1. Needs the extra uavrt[batch].

    Parameters
    ----------
    paths
        Recordings, and folders with recordings and flights: SigMF, WAV, and raw files whose
        rate and frequency a manifest gives; also in object stores that fsspec supports
        (s3://BUCKET/FOLDER). A recording's track has its name, in the same folder, and ends in
        .ulg, .bin, .tlog, .gpx or .nmea.
    tags
        Tag file: TagInfo.txt, tags.toml, or the original's detectorConfig.txt.
    output
        Directory for the tables.
    manifest
        CSV with columns path, format, sample_rate_hz, center_frequency_hz, start_time, track,
        clock_offset_s, vehicle for data that recordings lack; leave unknown cells empty.
    frequency_window
        Half-width of the search around each tag's nominal frequency, in hertz.
    workers
        Processes at a time; by default one for each core.
    scheduler
        tcp://HOST:PORT of a Dask cluster that does the work instead; its workers must see the
        files under the same names.
    cell
        Length of the cells of a recording that are searched in parallel, in seconds; the
        detector restarts in each. The result does not depend on the number of processes.
    lead_in
        Seconds before each cell that are read again to settle the noise estimate.
    steps
        Steps to run: detect, attach, bearing, localize, integrate; by default all but
        integrate. Integrate searches each flight with recorded channels for tags below the
        noise, and takes some seconds and 0.7 GB of memory for each flight. Without detect, the
        pulses detected earlier are used.
    method
        Method for positions from bearings: {position_methods}.
    verify
        Read all that was written before, and make damaged files again. Without it a file is
        checked by its size and time.
    """
    from uavrt.analysis.archive.batch_run import run_batch
    from uavrt.analysis.archive.recordings import find_recordings, read_manifest
    from uavrt.analysis.archive.steps.batch_settings import (
        USUAL_STEPS,
        BatchSettings,
        BatchWatch,
    )
    from uavrt.analysis.archive.steps.flight_work import PlacingSettings
    from uavrt.analysis.estimates.bearings import check_method
    from uavrt.analysis.estimates.positions import POSITION_METHODS
    from uavrt.analysis.measure.tag_source import read_tag_source
    from uavrt.cli.shown.outputs import make_directory
    from uavrt.cli.signals.detect import stop_on_signals

    sought = read_tag_source(tags)
    check_method(method, POSITION_METHODS)
    how = place.estimation_options(method)  # a damaged file is named before anything is done
    given = [one for one in (manifest, tags) if one is not None]
    listed = None if manifest is None else read_manifest(manifest)
    found = find_recordings(paths, listed, known=given)
    _print_skipped(found)
    if not found.recordings and not found.flights:
        raise UsageError(
            "no recording or flight was found",
            remedy="Name files, or folders that hold recordings or flights",
        )
    notice(
        f"{counted(len(found.recordings), 'recording')}, "
        f"{counted(len(found.flights), 'flight')}"
    )
    same = ("offset_deg", "method", "height_m", "heading_sigma_deg", "height_sigma_m")
    settings = BatchSettings(
        steps=tuple(steps or USUAL_STEPS),
        frequency_window_hz=frequency_window,
        cell_s=cell,
        lead_in_s=lead_in,
        verify=verify,
        workers=workers or os.cpu_count() or 1,
        scheduler=scheduler,
        placing=PlacingSettings(
            **{name: getattr(how, name) for name in same},
            antenna=place.antenna,
            dem=None if place.dem is None else str(place.dem.absolute()),
            sea=place.sea,
        ),
    )
    settings.check()
    make_directory(output, "-o")
    with stop_on_signals(_END_S) as stopped, _progress() as (on_stage, on_done):
        watch = BatchWatch(
            should_stop=lambda: stopped() is not None,
            on_stage=on_stage,
            on_done=on_done,
            on_row=_print_row,
            on_kept=lambda name, fault: notice(
                f"{name}: earlier result kept, not reachable now: {fault}"
            ),
            on_origin=lambda name, origin: notice(f"{name}: {origin}"),
            on_damage=lambda name, fault: notice(
                f"{name} was damaged and is made again: {fault}"
            ),
            on_wait=notice,
        )
        summary = None
        with suppress(KeyboardInterrupt):
            summary = run_batch(found, sought, output, settings, watch)
        number = stopped()
    if summary is None:
        notice(_STOPPED)
        _exit_now(128 + (number or signal.SIGINT))
    _report(summary, output)
    if number is not None:
        _exit_now(128 + number)
    states = [row.state for row in summary.rows] + [row.state for row in summary.flights]
    unread = any(one.unreadable for one in found.passed_over)
    if summary.kept or unread or {"truncated", "failed"} & set(states):
        sys.exit(1)


def _exit_now(status: int) -> NoReturn:
    """End the process at once: threads of libraries such as Dask may take seconds to end."""
    sys.stderr.flush()
    os._exit(status)


@contextmanager
def _progress() -> Iterator[tuple[Callable[[str, int], None], Callable[[int], None]]]:
    if not sys.stderr.isatty():
        yield (lambda _name, _total: None), (lambda _amount: None)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("looking", total=None)
        yield (
            lambda name, total: bar.reset(task, description=name, total=total),
            lambda amount: bar.advance(task, amount),
        )


def _print_row(row: "RecordingRow | FlightRow") -> None:
    if row.state in ("truncated", "failed"):
        notice(f"{row.path}: {row.state}: {row.fault}")


def _print_skipped(found: "Found") -> None:
    """Print the unreadable folders and the file name extensions of skipped files."""
    if found.kept_channels:
        files = counted(found.kept_channels, "file")
        notice(f"{files} of recorded channels skipped")
    kinds: dict[tuple[str, str], list[str]] = {}
    for one in found.passed_over:
        kind = one.path if one.unreadable else PurePath(one.path).suffix
        kinds.setdefault((one.reason, kind), []).append(one.path)
    for (reason, kind), paths in sorted(kinds.items()):
        if len(paths) == 1:
            notice(f"{paths[0]} skipped: {reason}")
        else:
            files = f"{len(paths)} files {kind}".rstrip()
            notice(f"{files} skipped, such as {paths[0]}: {reason}")


def _report(summary: "BatchSummary", output: Path) -> None:
    rows, flights = summary.rows, summary.flights
    known_s = [row.length_s for row in rows if row.length_s is not None]
    pulses = f"{sum(row.pulses for row in rows)} pulses in {counted(len(rows), 'recording')}"
    if known_s:
        pulses += f", {sum(known_s) / 3600.0:.1f} h"
        if unknown := len(rows) - len(known_s):
            pulses += f" and {unknown} of unknown length"
    notice(
        f"{counted(summary.done_now, 'recording')} done now, {summary.done_before} before; "
        f"{pulses}, "
        f"{sum(row.state == 'truncated' for row in rows)} truncated, "
        f"{sum(row.state == 'failed' for row in rows)} failed\n"
        f"{counted(summary.placed_now, 'flight')} placed now, {summary.placed_before} before; "
        f"{sum(row.bearings for row in flights)} bearings and "
        f"{sum(row.positions for row in flights)} positions of "
        f"{counted(len(flights), 'flight')}, "
        f"{sum(row.state == 'failed' for row in flights)} failed: {output}"
    )
    if summary.copies:
        directories = counted(summary.copies, "flight")
        notice(f"{directories} skipped: copies of flights that are there")
    noted = {
        "tags_outside": (
            sum(bool(row.tags_outside) for row in rows),
            "without the tags outside of its band",
        ),
        "beeps": (sum(bool(row.beeps) for row in rows), "with signals unlike the tag list"),
        "input_faults": (sum(bool(row.input_faults) for row in rows), "with poor samples"),
    }
    for column, (count, what) in noted.items():
        if count:
            notice(f"{counted(count, 'recording')} {what} ({column} in recordings.parquet)")
    if summary.kept:
        notice(f"earlier results kept, not reachable now: {summary.kept}")
    if summary.stopped:
        notice(_STOPPED)
