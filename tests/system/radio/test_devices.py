"""Two radios on one computer, as the doctor reports them: it runs the radio's own program."""

from pathlib import Path

import pytest
from tests.unit.radio.test_devices import HACKRF, Plug, plug_fixture  # noqa: F401  # fixture

from uavrt.computer.checks import check_radio
from uavrt.config import RadioSettings, Settings
from uavrt.radio import check_device


def test_doctor_says_it(plug: Plug, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    programs = tmp_path.with_name("programs")
    programs.mkdir()
    inform = programs / "hackrf_info"
    inform.write_text("#!/bin/sh\necho Found HackRF\n")
    inform.chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:/usr/bin:/bin")
    settings = RadioSettings(kind="hackrf")
    plug(HACKRF, "a1")
    assert "Found" in check_device(settings)
    plug(HACKRF, "b2")
    finding = check_radio(Settings(radio=settings), None)
    assert not finding.ok
    assert finding.text == "2 radios HackRF, and none is chosen"
    assert finding.remedy == 'Set [radio] serial to "a1" or "b2"'
