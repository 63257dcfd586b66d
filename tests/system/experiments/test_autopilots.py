"""A rehearsal on the simulated autopilot, in real time."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from uavrt_experiments.autopilots.builds import PX4_PORTS, free_instance
from uavrt_experiments.autopilots.measures import commands_of
from uavrt_experiments.autopilots.tap import read_frames


@pytest.mark.timeout(300)
def test_an_order_is_flown_taken_over_and_kept_frame_by_frame(tmp_path: Path) -> None:
    words = ("experiment", "autopilots", "--simulated", "px4", "--phases", "1", "--json")
    command = [sys.executable, "-m", "uavrt.cli", *words, "--only", "mode: land"]
    place = tmp_path / "rehearsal"
    for _ in range(2):  # the second finds it flown
        done = subprocess.run(
            [*command, "--output", str(place)], capture_output=True, text=True, timeout=240
        )
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
    assert "mode: land" in (place / "table.md").read_text()


def test_an_instance_of_px4_whose_port_is_taken_is_passed_over() -> None:
    first = free_instance()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", PX4_PORTS[0] + first))
        assert free_instance() != first
