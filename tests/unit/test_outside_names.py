"""What programs outside this repository call and read, in one list.

Names of commands and options, classes, and the tests that read what older versions and other
programs have written. Whoever changes one of these breaks somebody else's work.
"""

import runpy
import sys
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest
from command_line import uavrt

TESTS = Path(__file__).parents[1]

COMMANDS = {
    "demo": "--headless --json --duration",
    "run": "-c",
    "ground": "--no-browser",
    "detect": "--tags --format --sample-rate --center-frequency --start-time "
    "--frequency-window -o cf32 cs16 cu8 sigmf wav",
    "simulate": "SCENARIO -o",
    "bearing": "--method --antenna --json",
    "localize": "--method --json mle rmr mest bayes",
    "report": "FLIGHT",
    "export": "FLIGHT",
    "experiment": "resources packets capacity rotation detection localization recovery "
    "autopilots",
    "integrate": "--tag --json",
    "range": "",
    "coverage": "",
    "fly": "rotate goto survey search hold return stop status",
    "batch": "--tags -o",
    "archive": "",
    "update": "",
    "channelize": "",
    "monitor": "",
    "fetch": "",
    "attach": "",
    "season": "",
    "starter": "",
    "doctor": "",
    "service": "",
    "tags": "check convert measure",
}
"""By the command: words that its help shows."""

CALLED = {
    "uavrt.dsp.Decimator.process": "self block",
    "uavrt.dsp.Decimator.reset": "self",
    "uavrt.dsp.Channelizer.process": "self block",
    "uavrt.dsp.Channelizer.reset": "self",
    "uavrt.detection.PulseDetector": "tag sample_rate_hz center_frequency_hz",
    "uavrt.detection.PulseDetector.process": "self samples time_ns",
    "uavrt.detection.PulseDetector.flush": "self",
    "uavrt.localization.estimate_bearing": "method",
    "uavrt.localization.estimate_position": "stations powers method",
}
"""By the name: parameters that it has."""

READ = {
    "flights of older versions": "unit/flight/test_older_flights.py",
    "flights that are damaged": "unit/flight/test_damaged_flights.py",
    "pulse files, field by field": "unit/flight/test_pulse_files.py",
    "logs of other programs": "unit/golden/test_foreign_logs.py",
    "the original's pulses with poses": "unit/golden/test_pulse_pose_log.py",
    "bytes of the tunnel": "unit/golden/test_tunnel_bytes.py",
    "bytes of its numbered generations": "unit/golden/test_numbered_bytes.py",
    "bytes of named values": "unit/golden/test_named_value_bytes.py",
    "bytes of neighbours": "unit/golden/test_neighbour_bytes.py",
}
"""What is read: the test that reads it."""


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_and_options_keep_their_names(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    assert uavrt(command, "--help") == 0
    shown = capsys.readouterr().out
    assert [word for word in COMMANDS[command].split() if word not in shown] == []


def test_the_command_line_is_a_module_to_run(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["uavrt", "--help"])
    with pytest.raises(SystemExit, match="0"):
        runpy.run_module("uavrt.cli", run_name="__main__")
    shown = capsys.readouterr().out
    assert [name for name in COMMANDS if f" {name} " not in shown] == []


@pytest.mark.parametrize("name", CALLED)
def test_classes_and_functions_keep_their_names(name: str) -> None:
    package, *inside = name.removeprefix("uavrt.").split(".")
    found = import_module(f"uavrt.{package}")
    for part in inside:
        found = getattr(found, part)
    wanted = set(CALLED[name].split())
    assert wanted <= set(signature(found).parameters)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["Decimator", "Channelizer"])
def test_filters_tell_their_latency(name: str) -> None:
    assert hasattr(getattr(import_module("uavrt.dsp"), name), "latency_s")


@pytest.mark.parametrize("what", READ)
def test_what_others_have_written_is_read_by_a_test(what: str) -> None:
    assert "def test_" in (TESTS / READ[what]).read_text(encoding="utf-8")
