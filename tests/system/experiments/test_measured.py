"""Tables of results name a commit of the history, and tell a change of the code."""

import shutil
import subprocess
from pathlib import Path

import pytest

from uavrt_experiments import measured
from uavrt_experiments.detection.tables import FOLDERS, read_results, write_results
from uavrt_experiments.measured import (
    ROOT,
    SOURCE,
    digest,
    enter,
    in_history,
    main,
    read_parts,
)


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
    """Tables of this repository, and a copy of the code that may be changed."""
    for folder in (*FOLDERS, "localization", "tunnel", "mavlink"):
        shutil.copytree(SOURCE / folder, tmp_path / "source" / folder)
    (tmp_path / "docs" / "images").mkdir(parents=True)
    shutil.copytree(ROOT / "docs/images/detection", tmp_path / "docs/images/detection")
    original = digest
    monkeypatch.setattr(measured, "digest", lambda names: original(names, tmp_path / "source"))
    monkeypatch.setattr(
        measured, "read_parts", lambda root=tmp_path, read=read_parts: read(root)
    )
    monkeypatch.setattr(measured, "enter", lambda p, line, put=enter: put(p, line, tmp_path))
    table = read_results(tmp_path / "docs/images/detection/results.json")
    fresh = measured.measured_now(FOLDERS)
    for origin in table.origins.values():
        object.__setattr__(origin, "measured", fresh)
        object.__setattr__(origin, "notes", ())
    write_results(tmp_path / "docs/images/detection", table)
    return tmp_path


def test_a_change_is_told_with_what_to_run_until_it_is_entered(
    clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["show"]) == 0
    code = clone / "source" / "dsp" / "changed.py"
    code.write_text("x = 1\n", encoding="utf-8")
    assert main(["show"]) == 1
    told = capsys.readouterr().out
    assert "uavrt experiment detection --only E3 --trials 200 --output-dir docs/images" in told
    assert main(["enter", "E3", "a module that nothing imports"]) == 0
    assert main(["again", "E4", "the follower changed"]) == 0
    states = {part.name: part.state for part in measured.read_parts()}
    assert states["E3"] == "entered"
    assert states["E4"] == "to be measured again"
    assert states["E5"] == "changed"
    # A table that is written again, as by a campaign of another part, keeps what was entered.
    where = clone / "docs/images/detection"
    before = (where / "results.md").read_text(encoding="utf-8")
    write_results(where, read_results(where / "results.json"))
    assert (where / "results.md").read_text(encoding="utf-8") == before
    # The next change is one more.
    code.write_text("x = 2\n", encoding="utf-8")
    assert {p.name: p.state for p in measured.read_parts()}["E3"] == "changed"
    assert main(["enter", "all changed", "as before"]) == 0
    assert main(["show"]) == 0


def test_a_reason_is_one_line_and_a_part_is_one_of_the_tables(clone: Path) -> None:
    for parts, reason in (("E3", "two\nlines"), ("E3", " "), ("E99", "why")):
        with pytest.raises(SystemExit):
            main(["enter", parts, reason])
