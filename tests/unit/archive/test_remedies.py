"""A batch names no option that it does not have."""

import ast
import re
from inspect import signature
from pathlib import Path

from archived import TAG_LINE, TAGS, record
from command_line import Ran

from uavrt.analysis.archive.batch_run import run_batch
from uavrt.analysis.archive.recordings import find_recordings
from uavrt.analysis.archive.steps.batch_settings import BatchSettings
from uavrt.analysis.archive.steps.remedies import by_manifest
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.cli.results.batch import batch

SOURCE = Path(__file__).parents[3] / "src/uavrt"
OPTIONS = {name.replace("_", "-") for name in signature(batch).parameters}
OTHER_COMMANDS = {"simulation", "soapy.py", "radio_program.py", "live_source.py"}
"""No recording is read by these."""


def texts() -> list[str]:
    """All that readers of recordings and tracks say of options."""
    files = [*(SOURCE / "radio").rglob("*.py"), *(SOURCE / "formats/tracks").rglob("*.py")]
    files += (SOURCE / "analysis/tracks").rglob("*.py")
    found = []
    for file in files:
        if file.name in OTHER_COMMANDS:
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.JoinedStr):
                parts = (each.value for each in node.values if isinstance(each, ast.Constant))
                found.append("…".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return [text for text in found if re.search(r"--[a-z]", text)]


def test_what_readers_say_of_options_is_said_of_the_manifest() -> None:
    found = texts()
    assert len(found) >= 12
    for text in found:
        named = set(re.findall(r"--([a-z-]+)", by_manifest(text)))
        assert named <= OPTIONS, text
        assert "manifest" in named, text


def test_recordings_that_do_not_say_enough_are_told_by_columns(
    tmp_path: Path, ran: Ran
) -> None:
    folder, tags = tmp_path / "archive", tmp_path / "tags.txt"
    folder.mkdir()
    tags.write_text(TAG_LINE)
    record(folder / "a.cf32", 2.0, 1, tags=TAGS[:1])
    (folder / "b.wav").write_bytes(b"rubbish" * 100)
    (folder / "c.sigmf-meta").write_text("{")
    command = ("batch", folder, "--tags", tags, "-o", tmp_path / "out", "--workers", 1)
    said = ran(*command, ends=1).err
    for text in (
        "Give sample_rate_hz (in --manifest)",
        "Give its format (in --manifest)",
        "give format, sample_rate_hz and center_frequency_hz for ",
    ):
        assert text in said
    assert set(re.findall(r"--([a-z-]+)", said)) <= OPTIONS


def test_the_tables_say_it_as_the_command_does(tmp_path: Path) -> None:
    (tmp_path / "b.wav").write_bytes(b"rubbish" * 100)
    summary = run_batch(
        find_recordings([tmp_path]), TagSource(tags=TAGS), tmp_path / "out", BatchSettings()
    )
    assert [row.fault for row in summary.rows] == [
        f"{tmp_path / 'b.wav'} is not a WAV file. Give its format (in --manifest)"
    ]
