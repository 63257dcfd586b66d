"""The lesson on recordings, followed to the letter."""

import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.test_docs import FENCE, ROOT


def test_the_lesson_on_recordings_works_as_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lesson = (ROOT / "docs/tutorial/detect-a-recording.md").read_text(encoding="utf-8")
    found = FENCE.findall(lesson.replace("\\\n", " "))
    make_recording, read_pulses = (body for language, body in found if language == "python")
    tags = next(body for language, body in found if language == "text")
    detect = next(body for language, body in found if language == "sh")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(make_recording, names)
    (tmp_path / "TagInfo.txt").write_text(tags, encoding="utf-8")
    program, *arguments = shlex.split(detect)
    assert program == "uavrt"
    subprocess.run([sys.executable, "-m", "uavrt.cli", *arguments], check=True)
    exec(read_pulses, names)
    # The first pulse begins with the recording, where filters have nothing to go by.
    assert names["pulses"][-1]["confirmed"] == "true"
    assert len(names["times"]) >= 14
    np.testing.assert_allclose(np.diff(names["times"]), 1.254, atol=0.005)
