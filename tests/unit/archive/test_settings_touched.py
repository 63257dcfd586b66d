"""A setting has done again what it touches, and nothing else."""

from dataclasses import replace
from pathlib import Path

import made
import pytest
from archived import TAGS, recorded_flight
from tests.unit.whole_flight.conftest import keep_channel, rotation

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import Found, find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import (
    STEPS,
    USUAL_STEPS,
    BatchSettings,
    BatchSummary,
)
from uavrt.analysis.archive.steps.flight_work import PlacingSettings
from uavrt.analysis.measure.tag_source import TagSource

SOUGHT = TagSource(tags=TAGS[:1])


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Found, Path]:
    """A flight with a recording, searched and placed."""
    folder, output = (tmp_path_factory.mktemp(name) for name in ("archive", "searched"))
    recorded_flight(folder)
    found = find_recordings([folder], read_manifest(folder / "manifest.csv"))
    assert run_batch(found, SOUGHT, output, BatchSettings()).placed_now == 1
    return found, output


def placed_with(turned: tuple[Found, Path], **changed: object) -> int:
    found, output = turned
    placing = replace(PlacingSettings(), **changed)  # type: ignore[arg-type]
    return run_batch(found, SOUGHT, output, BatchSettings(placing=placing)).placed_now


def test_another_name_of_a_tag_has_nothing_done_again(turned: tuple[Found, Path]) -> None:
    found, output = turned
    renamed = TagSource(tags=(replace(TAGS[0], name="lynx"),))
    summary = run_batch(found, renamed, output, BatchSettings())
    assert (summary.done_now, summary.placed_now) == (0, 0)


def test_a_setting_that_is_not_read_has_nothing_done_again(turned: tuple[Found, Path]) -> None:
    # Heights count with a monopole, water with elevation files.
    assert placed_with(turned, height_sigma_m=20.0) == 0
    assert placed_with(turned, height_m=50.0) == 0
    assert placed_with(turned, sea=True) == 0
    for changed in ({"heading_sigma_deg": 3.0}, {"method": "mle"}, {"offset_deg": 5.0}):
        assert placed_with(turned, **changed) == 1, changed
    assert placed_with(turned, antenna="monopole") == 1
    assert placed_with(turned, antenna="monopole", heading_sigma_deg=3.0) == 0
    assert placed_with(turned, antenna="monopole", height_sigma_m=20.0) == 1
    assert placed_with(turned) == 1


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Found, TagSource, Path]:
    """A flight that kept its channel, judged as a whole."""
    folder, output = (tmp_path_factory.mktemp(name) for name in ("archive", "searched"))
    weak = rotation(3, 6.0)
    directory = folder / "flight_log_2023-11-14_22-13-20"
    info = replace(weak.flight.info, directory=str(directory), tags=(weak.tag,))
    made.flight(info, poses=weak.flight.poses)
    keep_channel(directory, weak)
    return find_recordings([folder]), TagSource(tags=info.tags), output


def test_a_verdict_of_a_whole_flight_is_kept_while_it_reads_the_same(
    judged: tuple[Found, TagSource, Path],
) -> None:
    found, sought, output = judged

    def run(steps: tuple[str, ...], **changed: object) -> BatchSummary:
        placing = replace(PlacingSettings(), **changed)  # type: ignore[arg-type]
        return run_batch(found, sought, output, BatchSettings(steps=steps, placing=placing))

    def verdicts() -> list[dict[str, object]]:
        return list(ask(output, "select * from integrated").to_pylist())

    def judged_at() -> int:
        (file,) = (output / "integrated").glob("*.parquet")
        return file.stat().st_mtime_ns

    assert run(STEPS).placed_now == 1
    first, at_ns = verdicts(), judged_at()
    assert len(first) == 1
    for steps, changed in ((STEPS, {"method": "mle"}), (USUAL_STEPS, {"offset_deg": 5.0})):
        summary = run(steps, **changed)
        assert summary.placed_now == 1
        assert summary.flights[0].steps == "attach,bearing,localize,integrate"
        assert (verdicts(), judged_at()) == (first, at_ns)
    assert run(STEPS, offset_deg=5.0).placed_now == 0
    assert run(STEPS, offset_deg=5.0, antenna="H3").placed_now == 1
    assert judged_at() != at_ns
    # What rests on what was changed does not stay, asked for or not.
    run(USUAL_STEPS, offset_deg=5.0)
    assert verdicts() == []


def test_a_step_that_is_asked_for_later_is_done_alone(turned: tuple[Found, Path]) -> None:
    found, output = turned
    run_batch(found, SOUGHT, output, BatchSettings())
    (file,) = (output / "positions").glob("*.parquet")
    before = file.stat().st_mtime_ns
    summary = run_batch(found, SOUGHT, output, BatchSettings(steps=STEPS))
    assert summary.placed_now == 1
    (file,) = (output / "positions").glob("*.parquet")
    assert file.stat().st_mtime_ns == before
    assert [(row.bearings, row.positions) for row in summary.flights] == [(2, 1)]
