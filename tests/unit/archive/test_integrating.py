"""A batch judges whole flights by the channels that they kept, as `uavrt integrate` does."""

from dataclasses import replace
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from tests.unit.whole_flight.conftest import keep_channel, rotation

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.parquet.questions import ask
from uavrt.analysis.archive.recordings import find_recordings
from uavrt.analysis.archive.steps.batch_settings import USUAL_STEPS, BatchSettings
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.errors import UsageError

ASKED = BatchSettings(steps=(*USUAL_STEPS, "integrate"))


def test_an_archive_tells_which_tags_whole_flights_show(tmp_path: Path, ran: Ran) -> None:
    weak = rotation(3, 6.0)
    directory = tmp_path / "archive" / "flight_log_2023-11-14_22-13-20"
    unkept = replace(weak.tag, tag_id=9, frequency_hz=weak.tag.frequency_hz + 50_000.0)
    info = replace(weak.flight.info, directory=str(directory), tags=(weak.tag, unkept))
    made.flight(info, poses=weak.flight.poses)
    found = find_recordings([directory.parent], None)
    sought = TagSource(tags=info.tags)
    output = tmp_path / "searched"
    before = run_batch(found, sought, output, ASKED)
    assert (before.placed_now, before.flights[0].state) == (1, "done")
    assert not ask(output, "SELECT * FROM integrated").num_rows

    keep_channel(directory, weak)
    found = find_recordings([directory.parent], None)
    after = run_batch(found, sought, output, ASKED)
    assert after.placed_now == 1  # its samples have come: it is judged again
    assert run_batch(found, sought, output, ASKED).placed_now == 0
    (row,) = ask(output, "SELECT * FROM integrated").to_pylist()
    (alone,) = ran("integrate", directory, "--tag", weak.tag.tag_id, "--json").json
    assert row["found"]
    assert row["flight"] == directory.name
    for name in ("tag_id", "false_alarm_probability", "interval_s", "frequency_hz"):
        assert row[name] == alone[name], name
    assert abs((row["bearing_deg"] - weak.bearing_deg + 180.0) % 360.0 - 180.0) < 15.0
    assert row["remarks"].startswith("antenna not specified")

    # Ground that lies elsewhere than the flight says: it is judged again, and that is told.
    dem = tmp_path / "N35W111.hgt"
    dem.write_bytes(np.full((1201, 1201), 4321, ">i2").tobytes())
    asked = replace(ASKED, placing=replace(ASKED.placing, dem=str(dem)))
    (flight,) = run_batch(found, sought, output, asked).flights
    assert flight.dem == str(dem)
    (row,) = ask(output, "SELECT * FROM integrated").to_pylist()
    assert row["found"]
    assert "datum" in row["remarks"]
    assert run_batch(found, sought, output, asked).placed_now == 0


def test_a_whip_judges_whole_flights_as_any_antenna_does(tmp_path: Path) -> None:
    flown = rotation(4, None, pulses=20)
    directory = tmp_path / "archive" / "flight_log_2023-11-14_22-13-20"
    made.flight(replace(flown.flight.info, directory=str(directory)), poses=flown.flight.poses)
    placing = replace(ASKED.placing, antenna="monopole")
    done = run_batch(
        find_recordings([directory.parent], None),
        TagSource(tags=flown.flight.info.tags),
        tmp_path / "searched",
        replace(ASKED, placing=placing),
    )
    assert "antenna's pattern" not in str(done.flights[0].fault)
    with pytest.raises(UsageError, match="integrate needs the step attach"):
        replace(ASKED, steps=("detect", "integrate")).check()
