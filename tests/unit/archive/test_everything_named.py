"""Everything below a path is searched or named, and what is not as it should be is named."""

import json
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from archived import (
    CENTER_HZ,
    COLUMNS,
    RATE_HZ,
    START,
    TAG_LINE,
    TAGS,
    manifest,
    record,
    write_flight,
)
from command_line import Ran

from uavrt.analysis.archive import recordings
from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.config.tags.tag_files import write_tags
from uavrt.dsp.input_check import GAIN_TOO_HIGH

LINES = TAG_LINE + "4, 150706000, 1210, 20, 20, 10, 3, 0.02\n"


def test_every_entry_is_searched_or_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "archive"
    flight = write_flight(root / "2026" / "flight_a", length_s=5.0)
    (flight / "notes.txt").write_text("belongs to the flight")
    gqrx = "gqrx_20260501_060000_148700000_24000_fc.raw"
    for name in (gqrx, "a.cf32", "UPPER.CS16", "b.raw", "photo.jpg", "c.sigmf-data"):
        (root / name).write_bytes(bytes(800))
    (root / "a.gpx").write_text("the track of a.cf32")
    (root / "closed").mkdir()
    (root / "elsewhere").symlink_to(tmp_path, target_is_directory=True)
    (root / "gone.cf32").symlink_to(tmp_path / "nowhere")
    os.mkfifo(root / "pipe")
    walk = os.walk

    def refusing(
        top: Path, *, onerror: Callable[[OSError], None]
    ) -> Iterator[tuple[str, list[str], list[str]]]:
        for folder, below, names in walk(top):
            if "closed" in below:  # the superuser may read it all the same
                onerror(PermissionError(13, "Permission denied", f"{top}/closed"))
                below.remove("closed")
            yield str(folder), below, names

    monkeypatch.setattr(os, "walk", refusing)
    found = find_recordings([root])
    searched = {one.path.name for one in found.recordings}
    assert searched == {gqrx, "a.cf32", "UPPER.CS16", "gone.cf32"}
    assert found.flights == {flight: "2026/flight_a"}
    named = {Path(one.path).name: (one.reason, one.unreadable) for one in found.passed_over}
    assert named == {
        "b.raw": (recordings.NO_RECORDING, False),
        "photo.jpg": (recordings.NO_RECORDING, False),
        "pipe": (recordings.NO_RECORDING, False),
        "c.sigmf-data": ("its .sigmf-meta is missing", True),
        "elsewhere": ("a link to a folder (name the folder itself)", True),
        "closed": ("cannot be read: Permission denied", True),
    }


def test_names_that_are_not_utf_8_are_named_and_the_others_searched(
    tmp_path: Path, ran: Ran
) -> None:
    root = tmp_path / "archive"
    flight = write_flight(root / "a", length_s=5.0)
    flight.rename(root / os.fsdecode(b"se\xf1al"))
    for name in (b"a\xe9.cf32", b"b.cf32"):
        (root / os.fsdecode(name)).write_bytes(bytes(800))
    (tmp_path / "tags.txt").write_text(TAG_LINE)
    command = ("batch", root, "--tags", tmp_path / "tags.txt", "--workers", 1)
    said = ran(*command, "-o", tmp_path / "out", ends=1).err
    for shown in ("a\\xe9.cf32", "se\\xf1al"):
        assert (
            f"{root}/{shown} skipped: the file name is not UTF-8 text (rename the file)" in said
        )
    assert "1 recording, 0 flights" in said
    assert pq.read_table(tmp_path / "out" / "passed_over.parquet").num_rows == 2


def test_the_command_names_them_and_keeps_a_list(tmp_path: Path, ran: Ran) -> None:
    root, output = tmp_path / "archive", tmp_path / "archive" / "searched"
    root.mkdir()
    (tmp_path / "tags.txt").write_text(TAG_LINE)
    (root / f"gqrx_20260501_060000_148700000_{RATE_HZ:.0f}_fc.raw").write_bytes(
        np.zeros(96_000, np.complex64).tobytes()
    )
    for number in range(3):
        (root / f"{number}.jpg").touch()
    (root / "c.sigmf-data").touch()
    command = ("batch", root, "--tags", tmp_path / "tags.txt", "--workers", 1)
    for _ in range(2):  # its own output is no part of the archive
        said = ran(*command, "-o", output, ends=1).err
        assert f"3 files .jpg skipped, such as {root}/0.jpg: the file name is not" in said
        assert f"{root}/c.sigmf-data skipped: its .sigmf-meta is missing" in said
    assert pq.read_table(output / "passed_over.parquet").num_rows == 4
    assert pq.read_table(output / "recordings.parquet")["state"].to_pylist() == ["done"]


def test_tags_outside_of_a_recordings_band_are_named_and_the_others_found(
    tmp_path: Path, ran: Ran
) -> None:
    (tmp_path / "tags.txt").write_text(LINES)
    record(tmp_path / "a.cf32", 16.0, 1, tags=TAGS[:1])
    place = ("--sample-rate", RATE_HZ, "--center-frequency", CENTER_HZ)
    command = ("detect", tmp_path / "a.cf32", "--tags", tmp_path / "tags.txt")
    told = ran(*command, *place, "--start-time", START)
    assert "tag 4 at 150.706000 MHz is outside of this recording's band" in told.err
    pulses = [json.loads(line) for line in told.out.splitlines()]
    assert {one["tag_id"] for one in pulses} == {2}
    assert len(pulses) >= 10
    # None of them inside: refused, as before.
    beyond = ("--sample-rate", 24000, "--center-frequency", 160e6)
    assert "outside the usable span" in ran(*command, *beyond, ends=2).err


def test_an_archive_of_two_bands_needs_one_list_of_tags(tmp_path: Path) -> None:
    # The first tag, as the same samples have it at another radio frequency.
    above_hz = TAGS[0].frequency_hz - CENTER_HZ
    tags = (TAGS[0], replace(TAGS[0], tag_id=4, frequency_hz=150.7e6 + above_hz))
    lines = [COLUMNS]
    for name, center_hz in (("low", CENTER_HZ), ("high", 150.7e6), ("none", 160e6)):
        record(tmp_path / f"{name}.cf32", 16.0, 1, tags=TAGS[:1])
        lines.append(f"{name}.cf32,,{RATE_HZ},{center_hz},{START}")
    (tmp_path / "manifest.csv").write_text("\n".join(lines) + "\n")
    told = recordings.read_manifest(tmp_path / "manifest.csv")
    found = find_recordings([tmp_path], told)
    summary = run_batch(found, TagSource(tags=tags), tmp_path / "out", BatchSettings())
    rows = {row.flight: row for row in summary.rows}
    assert {name: row.state for name, row in rows.items()} == {
        "low": "done",
        "high": "done",
        "none": "failed",
    }
    assert (rows["low"].tags_outside, rows["high"].tags_outside) == ((4,), (2,))
    assert "outside the usable span" in (rows["none"].fault or "")
    pulses = pq.read_table(tmp_path / "out" / "pulses").to_pylist()
    heard = {(one["flight"], one["tag_id"]) for one in pulses}
    assert heard == {("low", 2), ("high", 4)}


def test_the_table_of_recordings_names_a_tag_off_its_label_and_a_wrong_gain(
    tmp_path: Path, ran: Ran
) -> None:
    folder, output = tmp_path / "archive", tmp_path / "output"
    folder.mkdir()
    off = replace(TAGS[0], frequency_hz=TAGS[0].frequency_hz + 900.0)
    record(folder / "off.cf32", 25.0, 1, tags=(off, TAGS[1]))
    samples = np.fromfile(folder / "off.cf32", np.float32)
    np.clip(700.0 * samples, -1.0, 1.0).tofile(folder / "off.cf32")
    write_tags(tmp_path / "tags.toml", TAGS)
    inputs = ("--tags", tmp_path / "tags.toml", "--manifest", manifest(folder, "off.cf32"))
    said = ran("batch", folder, *inputs, "--workers", 1, "-o", output).err
    table = pq.read_table(output / "recordings.parquet")
    (beeps,) = table["beeps"].to_pylist()
    assert beeps.count("\n") == 0, "the other tag is as listed"
    assert re.search(r": tag 2, (89|90)\d Hz above its label", beeps)
    assert table["input_faults"].to_pylist() == [GAIN_TOO_HIGH]
    assert "1 recording with signals unlike the tag list (beeps in recordings.parquet)" in said
    assert "1 recording with poor samples (input_faults in recordings.parquet)" in said
