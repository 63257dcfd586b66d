"""The question whether the radio is there, with real programs."""

import os
import time
from pathlib import Path

import pytest

from uavrt.config.settings import RadioSettings
from uavrt.supervisor import radio_check
from uavrt.supervisor.radio_check import RadioQuestion
from uavrt.supervisor.usage import descendants_of, is_alive


def test_a_radio_that_answers_is_there_and_one_without_its_program_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "airspyhf_info"
    monkeypatch.setenv("PATH", str(tmp_path))
    question = RadioSettings(kind="airspyhf")
    found, text = RadioQuestion(question).answer()
    assert not found
    assert "airspyhf_info" in text
    program.write_text("#!/bin/sh\necho 'AirSpy HF+ S/N: 0x1234'\n")
    program.chmod(0o755)
    assert RadioQuestion(question).answer() == (True, "AirSpy HF+ S/N: 0x1234")


def test_a_radio_without_such_a_program_is_not_said_to_be_there() -> None:
    found, text = RadioQuestion(RadioSettings(kind="soapy")).answer()
    assert found
    assert text == "soapy: shows itself only in a flight"


def test_a_radio_program_that_hangs_is_ended_with_the_question(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "airspyhf_info"
    program.write_text("#!/bin/sh\nexec sleep 600\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(radio_check, "TIMEOUT_S", 5.0)
    question = RadioQuestion(RadioSettings(kind="airspyhf"))
    deadline_s = time.monotonic() + 30.0
    while not (started := descendants_of(question.pid)):
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    assert question.answer() == (False, "the radio was not asked (TimeoutExpired): try again")
    while any(map(is_alive, started)):
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
