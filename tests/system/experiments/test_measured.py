"""Tables of results name a commit of the history, and tell a change of the code."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from uavrt_experiments import measured
from uavrt_experiments.detection.tables import FOLDERS, read_results, write_results
from uavrt_experiments.measured import ROOT, SOURCE, digest, in_history, main, read_parts


def test_a_commit_that_is_not_in_the_history_is_told(tmp_path: Path) -> None:
    def git(where: Path, *command: str) -> str:
        who = (
            "-c",
            "user.name=A",
            "-c",
            "user.email=a@b.c",
            "-c",
            "protocol.file.allow=always",
        )
        line = ("git", "-C", str(where), *who, *command)
        return subprocess.run(line, capture_output=True, text=True, check=True).stdout.strip()

    whole, shallow = tmp_path / "whole", tmp_path / "shallow"
    whole.mkdir()
    git(whole, "init", "-q")
    for number in range(2):
        git(whole, "commit", "-q", "--allow-empty", "-m", str(number))
    first = git(whole, "rev-parse", "--short", "HEAD~1")
    git(whole, "checkout", "-q", "-b", "left", first)
    git(whole, "commit", "-q", "--allow-empty", "-m", "left behind")
    left = git(whole, "rev-parse", "--short", "HEAD")
    git(whole, "checkout", "-q", "-")
    assert in_history(f"{first}-dirty", whole) is True
    assert in_history(left, whole) is False
    assert in_history("0badbad", whole) is False
    git(tmp_path, "clone", "-q", "--depth", "1", whole.as_uri(), "shallow")
    assert in_history(first, shallow) is None
    assert in_history(first, tmp_path) is None


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The detector's table as measured now, and a copy of the code that may be changed."""
    for folder in FOLDERS:
        shutil.copytree(SOURCE / folder, tmp_path / "source" / folder)
    shutil.copytree(ROOT / "docs/images/detection", tmp_path / "docs/images/detection")
    original = digest
    monkeypatch.setattr(measured, "digest", lambda names: original(names, tmp_path / "source"))
    monkeypatch.setattr(
        measured, "read_parts", lambda root=tmp_path, read=read_parts: read(root)
    )
    table = read_results(tmp_path / "docs/images/detection/results.json")
    fresh = measured.measured_now(FOLDERS)
    origins = {name: replace(one, measured=fresh) for name, one in table.origins.items()}
    write_results(tmp_path / "docs/images/detection", replace(table, origins=origins))
    return tmp_path


def test_tables_older_than_their_code_are_listed_with_what_measures_them(
    clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main() == 0
    assert "; current" in capsys.readouterr().out
    code = clone / "source" / "dsp" / "changed.py"
    code.write_text("x = 1\n", encoding="utf-8")
    assert main() == 1
    listed = capsys.readouterr().out
    assert (
        "older: uavrt experiment detection --only E3 --trials 200 --output-dir docs" in listed
    )
    code.unlink()
    assert main() == 0


def test_the_line_of_a_measurement_names_date_and_machine() -> None:
    line = measured.measured_now(FOLDERS)
    _, day, machine, code, *_ = line.split(", ")
    assert re.fullmatch(r"20\d\d-\d\d-\d\d", day)
    assert re.fullmatch(r"\d+ cores of \S.*", machine)
    assert code.startswith("code `")
