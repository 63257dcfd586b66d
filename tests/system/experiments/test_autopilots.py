"""A rehearsal on the simulated autopilot, in real time."""

import json
import os
import signal
import socket
import subprocess
import tempfile
from pathlib import Path

import pytest
from command_line import launched, started
from until import until

from uavrt.drone.supervisor.start.usage import descendants_of
from uavrt_experiments.autopilots.builds import PX4_PORTS, free_instance
from uavrt_experiments.autopilots.measures import commands_of
from uavrt_experiments.autopilots.tap import read_frames
from uavrt_experiments.resources.usage import is_alive


@pytest.mark.timeout(300)
def test_an_order_is_flown_taken_over_and_kept_frame_by_frame(tmp_path: Path) -> None:
    words = ("experiment", "autopilots", "--simulated", "px4", "--phases", "1", "--json")
    place = tmp_path / "rehearsal"
    for _ in range(2):  # the second finds it flown
        done = started(*words, "--only", "mode: land", "--output", place, timeout=240)
        assert done.returncode == 0, done.stderr
        summary = json.loads(done.stdout.splitlines()[-1])
        assert summary["faults"] == []
        (line,) = summary["takeovers"]
        assert (line["takeover"], line["commands after"]) == ("mode: land", "0")
    assert "starts" not in done.stderr
    (frames,) = place.glob("*.tlog")
    kept = read_frames(frames)
    assert {one.frame.component_id for one in kept} >= {1, 191}
    assert commands_of(kept)
    table = (place / "table.md").read_text()
    assert "mode: land" in table
    assert "| delay in the rehearsal's relay, s |" in table


@pytest.mark.timeout(120)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_every_program_and_keeps_the_table(
    number: signal.Signals, tmp_path: Path
) -> None:
    words = ("experiment", "autopilots", "--simulated", "px4", "--quick", "--only", "goto")
    short = Path(tempfile.mkdtemp())  # the path of a Unix socket has room for 107 bytes
    with launched(
        *("-m", "uavrt.cli", *words, "--output", tmp_path / "rehearsal"),
        env=os.environ | {"TMPDIR": str(short)},
        stderr=subprocess.PIPE,
    ) as run:
        until(lambda: len(descendants_of(run.pid)) >= 4, 60.0)
        started = descendants_of(run.pid)
        run.send_signal(number)
        _, said = run.communicate(timeout=60.0)
    assert run.returncode == 130
    assert "the same command continues" in said
    assert not any(map(is_alive, started))
    short.rmdir()  # nothing is left in it
    assert (tmp_path / "rehearsal/table.md").exists()


@pytest.mark.timeout(60)
def test_an_autopilot_that_ends_at_its_start_is_named_at_once(tmp_path: Path) -> None:
    program = tmp_path / "arducopter"
    program.write_text("#!/bin/sh\necho no such model\nexit 3\n")
    program.chmod(0o755)
    words = ("experiment", "autopilots", "--arducopter", str(program), "--quick")
    done = started(*words, "--output", tmp_path / "rehearsal", timeout=50)
    assert done.returncode == 2
    assert "autopilot ended (exit 3): no such model" in done.stderr
    (log,) = (tmp_path / "rehearsal").glob("*autopilot.log")
    assert str(log) in done.stderr
    assert log.read_text() == "no such model\n"


def test_an_instance_of_px4_whose_port_is_taken_is_passed_over() -> None:
    first = free_instance()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", PX4_PORTS[0] + first))
        assert free_instance() != first
