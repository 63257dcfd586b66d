"""A batch names what beeps in a recording and is not as listed."""

import re
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
from archived import CENTER_HZ, COLUMNS, RATE_HZ, START, TAGS, record

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings, read_manifest
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.measure.tag_source import TagSource


def test_the_table_of_recordings_names_a_tag_off_its_label(tmp_path: Path) -> None:
    folder, output = tmp_path / "archive", tmp_path / "output"
    folder.mkdir()
    off = replace(TAGS[0], frequency_hz=TAGS[0].frequency_hz + 900.0)
    record(folder / "off.cf32", 25.0, 1, tags=(off, TAGS[1]))
    line = f"off.cf32,,{RATE_HZ},{CENTER_HZ},{START}\n"
    (folder / "manifest.csv").write_text(f"{COLUMNS}\n{line}")
    found = find_recordings([folder], read_manifest(folder / "manifest.csv"))
    run_batch(found, TagSource(tags=TAGS), output, BatchSettings(workers=1))
    (beeps,) = pq.read_table(output / "recordings.parquet")["beeps"].to_pylist()
    assert beeps.count("\n") == 0, "the other tag is as listed"
    assert re.search(r": tag 2, (89|90)\d Hz above its label", beeps)
