"""`uavrt tags`: what is measured is written, and only where and what can be read again."""

from pathlib import Path

import numpy as np
import pytest
from command_line import Ran
from sigmf_meta import write_meta
from tests.unit.cli import test_detect

from uavrt.config.tags.tag_files import read_tags

RATE_HZ = 8000.0
RADIO = ("--sample-rate", "8e3", "--center-frequency", "148.7e6")
CONFIG = test_detect.CONFIG.replace("ID:\t2", "ID:\t4").replace(
    "FreqMHz:\t148.71\ntp", "FreqMHz:\t148.7105\ntp"
)


def recording(path: Path, *tags: tuple[float, float]) -> None:
    """Write 25 s of noise with tags of 25 dB, each a frequency offset and an interval."""
    rng = np.random.default_rng(31)
    parts = rng.standard_normal((round(25 * RATE_HZ), 2)).astype(np.float32)
    samples = (parts * np.float32(0.5**0.5)).view(np.complex64).ravel()
    for place, (offset_hz, interval_s) in enumerate(tags):
        amplitude = np.sqrt(10**2.5 / (0.02 * RATE_HZ))
        for start_s in np.arange(0.4 + 0.3 * place, 24.5, interval_s):
            t = np.arange(round(start_s * RATE_HZ), round((start_s + 0.02) * RATE_HZ))
            wave = amplitude * np.exp(2j * np.pi * offset_hz * t / RATE_HZ)
            samples[t] += wave.astype(np.complex64)
    samples.tofile(path)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    recording(tmp_path / "a.cf32", (1200.0, 1.254))
    (tmp_path / "detectorConfig.txt").write_text(CONFIG)
    (tmp_path / "tags.txt").write_text("2, 148710000, 1254, 20, 60, 10, 3, 0.01\n")
    return tmp_path


def test_a_recording_cut_off_in_mid_sample_is_measured_and_its_fault_told(
    folder: Path, ran: Ran
) -> None:
    whole = (folder / "a.cf32").read_bytes()
    (folder / "a.cf32").write_bytes(whole[: len(whole) * 4 // 5 + 3])
    said = ran("tags", "measure", "a.cf32", *RADIO, "-o", "m.toml", ends=2).err
    assert said.count("all complete samples were used") == 1
    assert "16 pulses" in said
    (tag,) = read_tags(folder / "m.toml")
    assert abs(tag.frequency_hz - 148_701_200.0) <= 2.0
    assert tag.pulse_intervals_s[0] == pytest.approx(1.254, abs=1e-3)


def test_a_time_taken_from_the_files_date_is_told_with_the_measurement(
    folder: Path, ran: Ran
) -> None:
    assert "by the date of the file" in ran("tags", "measure", "a.cf32", *RADIO).err
    begun = ("--start-time", "2026-05-01T06:00:00Z")
    said = ran("tags", "measure", "a.cf32", *RADIO, *begun).err
    assert "by the date of the file" not in said
    assert "2026-05-01T06:00:0" in said


def test_a_cut_off_recording_without_a_tag_is_told_with_both_reasons(
    folder: Path, ran: Ran
) -> None:
    recording(folder / "a.cf32")
    with (folder / "a.cf32").open("ab") as file:
        file.write(b"123")
    said = ran("tags", "measure", "a.cf32", *RADIO, "-o", "m.toml", ends=2).err
    assert "all complete samples were used" in said
    assert "no regular pulses" in said
    assert not (folder / "m.toml").exists()


@pytest.mark.parametrize("center", ["148.7", "0", "148700"])
def test_a_centre_that_is_not_in_hertz_is_refused(folder: Path, ran: Ran, center: str) -> None:
    line = f"tags measure a.cf32 --sample-rate 8e3 --center-frequency {center} -o m.toml"
    said = ran(*line.split(), ends=2)
    assert "in hertz, such as 148.7e6" in said.err
    assert said.out == ""
    assert not (folder / "m.toml").exists()


def test_a_recording_that_says_a_wrong_centre_is_refused_with_the_right_one(
    folder: Path, ran: Ran
) -> None:
    (folder / "a.cf32").rename(folder / "a.sigmf-data")
    write_meta(folder / "a", RATE_HZ, {"frequency": 148.7})
    said = ran("tags", "measure", "a.sigmf-meta", "-o", "m.toml", ends=2).err
    assert "looks like a value in megahertz" in said
    assert "--center-frequency 148.7e6" in said
    assert not (folder / "m.toml").exists()


def test_the_names_of_several_tags_are_numbered(folder: Path, ran: Ran) -> None:
    recording(folder / "a.cf32", (-2000.0, 1.254), (2000.0, 1.1))
    line = ("tags", "measure", "a.cf32", *RADIO, "--id", "6", "--name", "Luna", "-o", "m.toml")
    ran(*line)
    assert [(tag.tag_id, tag.name) for tag in read_tags(folder / "m.toml")] == [
        (6, "Luna 1"),
        (8, "Luna 2"),
    ]


def test_a_detector_config_is_checked_and_converted(folder: Path, ran: Ran) -> None:
    assert (
        "tag 4: 148.710500 MHz, 20 ms every 1254 ms"
        in ran("tags", "check", "detectorConfig.txt").out
    )
    assert "operating mode" in ran("tags", "convert", "detectorConfig.txt", "m.toml").out
    (tag,) = read_tags(folder / "m.toml")
    assert (tag.tag_id, tag.frequency_hz, tag.k) == (4, 148_710_500.0, 3)


@pytest.mark.parametrize(("interval_ms", "told"), [(750, True), (840, False)])
def test_intervals_at_a_small_ratio_are_warned_of(
    interval_ms: int, told: bool, folder: Path, ran: Ran
) -> None:
    (folder / "TagInfo.txt").write_text(
        "2, 148700000, 1500, 20, 5, 1, 3, 0.05\n"
        f"4, 148700000, {interval_ms}, 20, 5, 1, 3, 0.05\n"
    )
    said = ran("tags", "check", "TagInfo.txt")
    assert ("tags 2 and 4 may have the ratio 2 to 1" in said.out + said.err) == told


@pytest.mark.parametrize(
    ("written", "instead", "says"),
    [
        ("tagFreqMHz:\t148.7105\n", "", "lacks the key tagFreqMHz"),
        ("tagFreqMHz:\t148.7105", "tagFreqMHz:\t148710500", "tagFreqMHz is 148710500"),
        ("tip:\t1.254", "tip:\t-1", "tip is -1"),
        ("ID:\t4", "ID:\t0", "must be a whole number from 1"),
    ],
)
def test_faults_of_a_detector_config_are_named(
    folder: Path, ran: Ran, written: str, instead: str, says: str
) -> None:
    (folder / "detectorConfig.txt").write_text(CONFIG.replace(written, instead))
    said = ran("tags", "check", "detectorConfig.txt", ends=2).err
    assert says in said
    assert "values instead of" not in said
    ran("tags", "convert", "detectorConfig.txt", "m.toml", ends=2)
    assert not (folder / "m.toml").exists()


@pytest.mark.parametrize("target", ["m.csv", "m", "m.json", "DetectorConfig.txt"])
def test_tags_are_written_only_under_names_of_tag_files(
    folder: Path, ran: Ran, target: str
) -> None:
    for line in (("convert", "tags.txt", target), ("measure", "a.cf32", *RADIO, "-o", target)):
        said = ran("tags", *line, ends=2)
        assert "Choose a name that ends in .toml" in said.err
        assert "pulses" not in said.err  # told before the work
        assert not (folder / target).exists()


def test_the_databases_of_tagtracker_are_checked_and_converted(
    tmp_path: Path, ran: Ran
) -> None:
    source, target = tmp_path / "TagInfo.db", tmp_path / "tags.toml"
    source.write_text("1;2;luna;1;146,123456\n0;4;sol;1;146,2\n")
    assert "TagManufacturer.db" in ran("tags", "check", source, ends=2).err
    makers = tmp_path / "TagManufacturer.db"
    makers.write_text("1;ATS;1333;2000;Moving;Resting;15;60;20\n")
    assert "146.123456 MHz, 15 ms every 1333 and 2000 ms" in ran("tags", "check", source).out
    told = ran("tags", "convert", source, target).out
    assert [tag.name for tag in read_tags(target)] == ["luna", "sol"]
    assert "4 is not selected" in told
