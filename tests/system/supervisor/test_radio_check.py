"""The question whether the radio is connected, with real programs."""

import asyncio
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from until import until

from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.core.messages import Command, CommandReply
from uavrt.drone.ipc.topics import decode_record
from uavrt.drone.supervisor.core import Supervisor
from uavrt.drone.supervisor.mission import radio_check
from uavrt.drone.supervisor.mission.radio_check import RadioTest
from uavrt.drone.supervisor.start.usage import descendants_of
from uavrt_experiments.resources.usage import is_alive

SETTINGS = RadioSettings(kind="airspyhf", sample_rate_hz=768e3)
PACED = """
import os, sys, time
begun, sent = time.monotonic(), 0
while True:
    sent += os.write(1, bytes([0, 0, 0, 60] * 2 * 8192)) // 8
    time.sleep(max(0.0, begun + sent / 768e3 - time.monotonic()))
"""
WORKS = "Airspy HF+: 768000 samples a second arrive"


def install(program: Path, body: str) -> None:
    program.write_text(body)
    program.chmod(0o755)


def test_a_radio_that_sends_samples_is_there_and_one_without_its_program_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    found, text = RadioTest(SETTINGS).answer()
    assert not found
    assert "airspyhf_rx is not installed" in text
    install(tmp_path / "airspyhf_rx", f"#!{sys.executable}\n{PACED}")
    assert RadioTest(SETTINGS).answer() == (True, WORKS)


def test_soapy_without_its_module_is_not_said_to_be_there() -> None:
    found, text = RadioTest(RadioSettings(kind="soapy")).answer()
    assert (found, "python3-soapysdr" in text) == (False, True)


def test_a_radio_program_that_hangs_is_ended_with_the_question(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path / "airspyhf_rx", "#!/bin/sh\nexec sleep 600\n")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(radio_check, "TIMEOUT_S", 3.0)
    question = RadioTest(SETTINGS)
    started = until(lambda: descendants_of(question.pid))
    assert question.answer() == (
        False,
        "the radio could not be checked (TimeoutExpired): try again",
    )
    until(lambda: not any(map(is_alive, started)))


def test_a_radio_program_that_hangs_dies_with_a_killed_supervisor(tmp_path: Path) -> None:
    install(tmp_path / "airspyhf_rx", f"#!/bin/sh\necho x > {tmp_path}/asked\nexec sleep 600\n")
    asking = (
        "from uavrt.config.settings import RadioSettings\n"
        "from uavrt.drone.supervisor.mission.radio_check import RadioTest\n"
        "RadioTest(RadioSettings(kind='airspyhf', sample_rate_hz=768e3)).answer()"
    )
    path = f"{tmp_path}:{os.environ['PATH']}"
    supervisor = subprocess.Popen([sys.executable, "-c", asking], env={"PATH": path})
    until((tmp_path / "asked").exists)
    asked = descendants_of(supervisor.pid)
    assert len(asked) == 2
    supervisor.send_signal(signal.SIGKILL)
    supervisor.wait()
    until(lambda: not any(map(is_alive, asked)))


async def test_the_operator_asks_twice_and_the_radio_is_asked_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = tmp_path / "asked"
    body = PACED.replace("begun", f"open({str(asked)!r}, 'a').write('x')\nbegun", 1)
    install(tmp_path / "airspyhf_rx", f"#!{sys.executable}\n{body}")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    records: list[bytes] = []
    settings = Settings(radio=SETTINGS, recording=RecordingSettings(directory=str(tmp_path)))
    supervisor = Supervisor(settings, on_record=records.append)
    questions = [Command(name="radio_status", request_id=n, source="page") for n in (1, 2)]
    await asyncio.gather(*map(supervisor._answer_radio_status, questions))
    replies = [decode_record(line.strip())[1] for line in records]
    assert replies == [
        CommandReply(request_id=n, name="radio_status", accepted=True, message=WORKS)
        for n in (1, 2)
    ]
    assert asked.read_text() == "x"
