"""A batch names what beeps in a recording and is not as listed, and poor samples."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from archived import CENTER_HZ, COLUMNS, RATE_HZ, START, TAGS, record
from command_line import uavrt

from uavrt.config.tags.tag_files import write_tags
from uavrt.dsp.input_check import GAIN_TOO_HIGH


def test_the_table_of_recordings_names_a_tag_off_its_label_and_a_wrong_gain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, output = tmp_path / "archive", tmp_path / "output"
    folder.mkdir()
    off = replace(TAGS[0], frequency_hz=TAGS[0].frequency_hz + 900.0)
    record(folder / "off.cf32", 25.0, 1, tags=(off, TAGS[1]))
    samples = np.fromfile(folder / "off.cf32", np.float32)
    np.clip(700.0 * samples, -1.0, 1.0).tofile(folder / "off.cf32")
    line = f"off.cf32,,{RATE_HZ},{CENTER_HZ},{START}\n"
    (folder / "manifest.csv").write_text(f"{COLUMNS}\n{line}")
    write_tags(tmp_path / "tags.toml", TAGS)
    inputs = ("--tags", str(tmp_path / "tags.toml"), "--manifest", str(folder / "manifest.csv"))
    assert uavrt("batch", str(folder), *inputs, "--workers", "1", "-o", str(output)) == 0
    table = pq.read_table(output / "recordings.parquet")
    (beeps,) = table["beeps"].to_pylist()
    assert beeps.count("\n") == 0, "the other tag is as listed"
    assert re.search(r": tag 2, (89|90)\d Hz above its label", beeps)
    assert table["input_faults"].to_pylist() == [GAIN_TOO_HIGH]
    said = capsys.readouterr().err
    assert "1 recording with signals unlike the tag list (beeps in recordings.parquet)" in said
    assert "1 recording with poor samples (input_faults in recordings.parquet)" in said
