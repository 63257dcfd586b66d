"""Detection and its kernels on 64-bit ARM, by an emulator; deploy/try-arm64.sh does more."""

import os
import sys
from pathlib import Path

import pytest
from command_line import program

SHORT = Path(__file__).parents[2] / "deploy/arm64/short.sh"
NOT_HERE = 77

pytestmark = pytest.mark.timeout(1200)


def test_an_arm_computer_finds_the_same_pulses(pytestconfig: pytest.Config) -> None:
    """Times to the sample, SNR within 0.001 dB; packages are fetched once and kept."""
    kept = pytestconfig.cache.mkdir("arm64")
    done = program(SHORT, kept, env=os.environ | {"PYTHON": sys.executable})
    said = (done.stdout + done.stderr).splitlines()
    if done.returncode == NOT_HERE:
        pytest.skip(said[-1])
    assert done.returncode == 0, "\n".join(said)
    assert [line.split(":")[0] for line in done.stdout.splitlines()] == [
        "ok kernels",
        "ok recording",
    ]
