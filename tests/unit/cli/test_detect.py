"""`uavrt detect` of a short recording of one channel."""

import csv
from pathlib import Path

import numpy as np
import pytest
from command_line import uavrt

from uavrt.experiments.detection.signals import THESIS_TAG, make_samples, pulse_train

SECONDS = 14.0
OFFSET_HZ = 300.0
RADIO = ("--sample-rate", "3750", "--center-frequency", "148.71e6")
CONFIG = """\
####
ID:\t2
channelCenterFreqMHz:\t148.71
Fs:\t3750
tagFreqMHz:\t148.71
tp:\t0.02
tip:\t1.254
tipu:\t0.06
tipj:\t0.01
K:\t3
opMode:\tfreqKnownHardLock
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tag of 20 dB, 300 Hz above its nominal frequency, and files that describe it."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(21)
    pulses = pulse_train(
        rng, duration_s=SECONDS, interval_s=1.254, offset_hz=OFFSET_HZ, enr_db=20.0
    )
    make_samples(rng, pulses, duration_s=SECONDS).tofile(tmp_path / "a.cf32")
    (tmp_path / "tags.txt").write_text("2, 148710000, 1254, 20, 60, 10, 3, 0.01\n")
    (tmp_path / "detectorConfig.txt").write_text(CONFIG)
    assert THESIS_TAG.frequency_hz == 148.71e6
    return tmp_path


def found(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("arguments", "pulses"),
    [
        (("--tags", "tags.txt"), 11),
        (("--tags", "tags.txt", "--mode", "freqKnownHardLock"), 0),
        (("--tags", "detectorConfig.txt"), 0),
        (("--tags", "detectorConfig.txt", "--mode", "freqSearchHardLock"), 11),
        (("--tags", "tags.txt", "--mode", "freqAllNeverLock", "--frequency-window", "50"), 11),
    ],
)
def test_the_mode_asked_for_decides_what_is_found(
    folder: Path, arguments: tuple[str, ...], pulses: int
) -> None:
    assert uavrt("detect", "a.cf32", *RADIO, *arguments, "-o", "p.csv") == 0
    assert len(found(folder / "p.csv")) == pytest.approx(pulses, abs=1 if pulses else 0)


def test_a_mode_that_does_not_exist_is_refused_with_the_four(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert uavrt("detect", "a.cf32", *RADIO, "--tags", "tags.txt", "--mode", "hard") != 0
    both = capsys.readouterr()
    assert "freqSearchHardLock" in both.out + both.err
