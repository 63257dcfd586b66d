"""Tables of results name a commit of the history."""

import subprocess
from pathlib import Path

from uavrt_experiments.measured import (
    in_history,
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
