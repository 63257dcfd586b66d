"""A package outside of the tree adds estimators, an antenna and a radio by entry points.

It is installed into a directory of its own and used by the real command line.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import started

from uavrt.core.errors import ConfigError
from uavrt.core.plugins import Registry
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.antenna import PATTERNS, AntennaPattern

EXTENSION = Path(__file__).parents[1] / "extension"
Uavrt = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package, installed by pip from its sources, without any index."""
    target = tmp_path_factory.mktemp("installed")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    options = ["--no-build-isolation", "--disable-pip-version-check", "--no-cache-dir"]
    subprocess.run([*command, *options, "--target", target, EXTENSION], check=True)
    return target


def environment(installed: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(installed), "OPENBLAS_NUM_THREADS": "1"}


@pytest.fixture
def uavrt(installed: Path, tmp_path: Path) -> Uavrt:
    def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
        return started(*arguments, cwd=tmp_path, env=environment(installed), timeout=60)

    return run


@pytest.fixture
def pulses(tmp_path: Path) -> Path:
    """A turn past a tag in the north-east, as TagTracker logs it."""
    lines = []
    for number in range(36):
        yaw = 10.0 * number
        snr = 25.0 + PATTERNS["RA-23K"].gain_db(45.0 - yaw)
        start_s = 1_700_000_000.0 + 1.25 * number
        lines.append(
            f"7,2,148710225,{start_s:.6f},{start_s + 1.25:.6f},{snr:.3f},2.7,1,1,"
            f"{snr:.3f},1e-12,1,1,47.0,8.5,40.0,0,0,{yaw},0"
        )
    path = tmp_path / "Pulse-2026-05-01.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_an_estimator_of_another_package_gives_bearings(uavrt: Uavrt, pulses: Path) -> None:
    finished = uavrt("bearing", str(pulses), "--method", "toy_mean", "--json")
    assert finished.returncode == 0, finished.stderr
    (found,) = json.loads(finished.stdout)
    assert found["method"] == "toy_mean"
    assert abs(found["bearing_deg"] - 45.0) < 10.0


def test_an_antenna_of_another_package_is_used_by_its_name(uavrt: Uavrt, pulses: Path) -> None:
    nominal = uavrt("bearing", str(pulses), "--json")
    other = uavrt("bearing", str(pulses), "--antenna", "toy loop", "--json")
    assert other.returncode == 0, other.stderr
    levels = [json.loads(one.stdout)[0]["level_db"] for one in (nominal, other)]
    assert levels[0] != levels[1]
    unknown = uavrt("bearing", str(pulses), "--antenna", "toy horn")
    assert unknown.returncode == 2
    assert "toy loop" in unknown.stderr


def test_a_position_estimator_of_another_package_gives_positions(
    uavrt: Uavrt, tmp_path: Path
) -> None:
    bearings = tmp_path / "bearings.csv"
    bearings.write_text("2,a,45,0.5,47.0,8.5,40,500,1,2\n2,b,30,0.5,47.002,8.5,40,500,3,4\n")
    finished = uavrt("localize", str(bearings), "--method", "toy_middle", "--json")
    assert finished.returncode == 0, finished.stderr
    (found,) = json.loads(finished.stdout)
    assert found["method"] == "toy_middle"
    assert found["latitude_deg"] == pytest.approx(47.001)


def test_what_cannot_be_loaded_names_its_package(uavrt: Uavrt, pulses: Path) -> None:
    finished = uavrt("bearing", str(pulses), "--antenna", "broken")
    assert finished.returncode == 2
    assert "uavrt-toy" in finished.stderr
    assert "Traceback" not in finished.stderr


def test_a_radio_kind_that_nobody_adds_is_refused_with_those_that_are(
    uavrt: Uavrt, tmp_path: Path
) -> None:
    (tmp_path / "uavrt.toml").write_text('[radio]\nkind = "crystal"\n')
    finished = uavrt("run", "--config", "uavrt.toml")
    assert finished.returncode == 2
    assert "line 2" in finished.stderr
    assert "toy_beeper" in finished.stderr
    assert "airspyhf" in finished.stderr


def test_a_radio_of_another_package_is_flown_with(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "uavrt.toml").write_text(
        '[radio]\nkind = "toy_beeper"\nsample_rate_hz = 250000.0\n'
        "center_frequency_hz = 148700000.0\n",
        encoding="utf-8",
    )
    (tmp_path / "TagInfo.txt").write_text(
        "2, 148710000, 500, 20, 20, 5, 3, 0.01\n", encoding="utf-8"
    )
    command = [sys.executable, "-m", "uavrt.cli", "run", "--config", "uavrt.toml"]
    options = ["--mavlink", "none", "--tags", "TagInfo.txt", "--flight-dir", "flights"]
    with (tmp_path / "run.log").open("wb") as output:
        drone = subprocess.Popen(
            [*command, *options],
            cwd=tmp_path,
            env=environment(installed),
            stdout=output,
            stderr=subprocess.STDOUT,
            process_group=0,
        )
    try:
        starts = pulse_starts_s(tmp_path / "flights", at_least=4)
    finally:
        drone.send_signal(signal.SIGTERM)
        drone.wait(30.0)
    assert len(starts) >= 4, (tmp_path / "run.log").read_text()
    beats = np.diff(starts) / 0.5
    assert np.abs(beats - np.round(beats)).max() < 0.02


def pulse_starts_s(flights: Path, *, at_least: int) -> list[float]:
    """Wait for so many pulses in the only flight there is; what came within a minute."""
    starts: list[float] = []
    deadline_s = time.monotonic() + 60.0
    while len(starts) < at_least and time.monotonic() < deadline_s:
        time.sleep(0.5)
        for directory in flights.glob("flight_log_*/flight.sqlite"):
            flight = read_flight(directory.parent)
            starts = sorted(one.pulse.start_time_ns / 1e9 for one in flight.pulse_poses)
    return starts


def test_our_own_names_cannot_be_taken_and_wrong_things_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from importlib.metadata import EntryPoint

    added = [
        EntryPoint(name="RA-2A", value="json:dumps", group="uavrt.antennas"),
        EntryPoint(name="number", value="math:pi", group="uavrt.antennas"),
    ]
    monkeypatch.setattr("uavrt.core.plugins.entry_points", lambda **_: added)
    registry: Registry[Any] = Registry(
        "uavrt.antennas", {"RA-2A": PATTERNS["RA-2A"]}, AntennaPattern
    )
    assert list(registry) == ["RA-2A", "number"]
    assert registry["RA-2A"] is PATTERNS["RA-2A"]
    with pytest.raises(ConfigError, match="AntennaPattern"):
        registry["number"]
    with pytest.raises(KeyError):
        registry["nothing"]
