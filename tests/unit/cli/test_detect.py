"""`uavrt detect` of a short recording of one channel."""

import csv
import socket
from pathlib import Path

import numpy as np
import pytest
from command_line import Ran

from uavrt.drone.ipc.pulse_datagram import PulseRecord
from uavrt_experiments.detection.signals import THESIS_TAG, make_samples, pulse_train

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


@pytest.fixture(name="folder")
def folder_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
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
    folder: Path, ran: Ran, arguments: tuple[str, ...], pulses: int
) -> None:
    ran("detect", "a.cf32", *RADIO, *arguments, "-o", "p.csv")
    assert len(found(folder / "p.csv")) == pytest.approx(pulses, abs=1 if pulses else 0)


def test_a_mode_that_does_not_exist_is_refused_with_the_four(folder: Path, ran: Ran) -> None:
    wrong = ("--tags", "tags.txt", "--mode", "hard")
    assert "freqSearchHardLock" in ran("detect", "a.cf32", *RADIO, *wrong, ends=2).words


def test_a_controller_hears_that_nothing_was_found_only_while_nothing_is(
    folder: Path, ran: Ran
) -> None:
    rng = np.random.default_rng(22)
    heard = pulse_train(
        rng, duration_s=20.0, interval_s=1.254, offset_hz=OFFSET_HZ, enr_db=20.0
    )
    make_samples(rng, heard, duration_s=35.0).tofile(folder / "lost.cf32")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
        controller.bind(("127.0.0.1", 0))
        controller.setblocking(False)
        place = f"127.0.0.1:{controller.getsockname()[1]}"
        start = ("--start-time", "2024-01-01T00:00:00Z")
        arguments = ("lost.cf32", *RADIO, *start, "--tags", "tags.txt", "-o", "p.csv")
        ran("detect", *arguments, "--udp-pulses", place)
        records = []
        while True:
            try:
                records.append(PulseRecord.decode(controller.recv(200)))
            except BlockingIOError:
                break
    pulses_s = [r.start_time_s for r in records if r.frequency_hz and r.snr_db > 15.0]
    searches_s = [r.start_time_s for r in records if r.detection_status == 3]
    assert len(pulses_s) == pytest.approx(16, abs=1)
    assert not [s for s in searches_s if min(pulses_s) < s < max(pulses_s)]
    assert len([s for s in searches_s if s > max(pulses_s) + 2.5]) >= 10


@pytest.mark.parametrize("cut", [0, 3])
def test_pictures_are_drawn_of_what_there_is_also_when_the_file_is_cut_off(
    folder: Path, ran: Ran, cut: int
) -> None:
    whole = (folder / "a.cf32").read_bytes()
    (folder / "cut.cf32").write_bytes(whole[: len(whole) - cut])
    arguments = ("cut.cf32", *RADIO, "--tags", "tags.txt", "-o", "p.csv", "--plot", "pictures")
    said = ran("detect", *arguments, ends=2 if cut else 0).err
    assert len(found(folder / "p.csv")) == pytest.approx(11, abs=1)
    assert len(list((folder / "pictures").glob("*.png"))) == 3
    assert ("middle of a sample" in said) == bool(cut)
    assert said.index("pulses, ") < said.index(".png")


def test_nothing_is_drawn_when_nothing_was_read(folder: Path, ran: Ran) -> None:
    (folder / "far.txt").write_text("2, 151710000, 1254, 20, 60, 10, 3, 0.01\n")
    arguments = ("a.cf32", *RADIO, "--tags", "far.txt", "-o", "p.csv", "--plot", "pictures")
    ran("detect", *arguments, ends=2)
    assert not list((folder / "pictures").glob("*"))
