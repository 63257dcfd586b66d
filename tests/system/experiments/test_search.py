"""Ctrl-C in a campaign of searches."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


@pytest.mark.parametrize("workers", ["1", "2"])
def test_ctrl_c_prints_what_is_done_and_keeps_it(tmp_path: Path, workers: str) -> None:
    kept = tmp_path / "kept.jsonl"
    words = ("--only", "T7", "--runs", "400", "--particles", "100", "--workers", workers)
    command = [sys.executable, "-m", "uavrt.cli", "experiment", "search", *words]
    with subprocess.Popen(
        [*command, "--no-baselines", "--kept", str(kept)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as running:
        while running.poll() is None and lines_of(kept) < 3:
            time.sleep(0.05)
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does
        out, errors = running.communicate(timeout=60)
    assert running.returncode == 130, errors
    assert "repeat it to go on" in errors
    assert "Traceback" not in errors
    assert "T7  Cliff: one animal that rests" in out
    done = int(re.findall(r"mi_rate .* 0 of (\d+)$", out, re.MULTILINE)[0])
    assert 2 <= done < 400
    assert lines_of(kept) == done + 1


def lines_of(path: Path) -> int:
    return path.read_text(encoding="utf-8").count("\n") if path.exists() else 0
