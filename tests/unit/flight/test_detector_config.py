"""``detectorConfig.txt`` as the original detector reads it, and read from it."""

from dataclasses import replace
from pathlib import Path

import made
import pytest

from uavrt.core.errors import FormatError
from uavrt.flight.logs.detector_configs import (
    detector_config,
    read_detector_config,
    write_detector_config,
)

TAG = made.tag(
    interval_uncertainty_s=0.060, interval_jitter_s=0.010, false_alarm_probability=0.005
)
TIME_NS = 1_700_205_419_230_494_976


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "detectorConfig.txt"


def original_reader(text: str) -> dict[str, str]:
    """Read as the original does: no blank lines, last record."""
    record: dict[str, str] = {}
    for line in text.rstrip("\n").split("\n"):
        assert line, "the original crashes on an empty line"
        if line.startswith("#"):
            record = {}
        else:
            record[line[: line.index(":")]] = line[line.index("\t") + 1 :]
    return record


def test_the_original_finds_what_it_needs(path: Path) -> None:
    write_detector_config(path, detector_config(TAG, 148.7e6, "/logs/tag_id_2"), TIME_NS)
    text = path.read_text()
    assert text.startswith("##")
    values = original_reader(text)
    assert values["ID"] == "2"
    # 10 kHz above the centre: 2.67 channels, so channel 3.
    assert float(values["channelCenterFreqMHz"]) == 148.71125
    assert values["portData"] == "20003"
    assert values["portCntrl"] == "30003"
    assert float(values["Fs"]) == 3750.0
    assert [float(values[key]) for key in ("tp", "tip", "tipu", "tipj")] == [
        0.02,
        1.254,
        0.06,
        0.01,
    ]
    assert values["K"] == "3"
    assert values["opMode"] == "freqSearchSoftLock"
    assert values["excldFreqs"] == "[Inf, -Inf]"
    assert float(values["falseAlarmProb"]) == 0.005
    assert values["timeStamp"] == "2023-11-17T07:16:59.230494Z"


@pytest.mark.parametrize(
    ("offset_hz", "port"),
    [(0.0, 20000), (3750.0, 20001), (-3750.0, 20099), (183_750.0, 20049), (-187_500.0, 20050)],
)
def test_channels_count_up_from_the_centre_and_wrap(offset_hz: float, port: int) -> None:
    config = detector_config(TAG, TAG.frequency_hz - offset_hz)
    assert config.data_port == port
    assert config.channel_center_frequency_hz == TAG.frequency_hz


def test_a_tag_beyond_the_channels_has_no_port() -> None:
    config = detector_config(TAG, TAG.frequency_hz - 250_000.0)
    assert config.data_port == 0
    assert config.channel_center_frequency_hz == TAG.frequency_hz


def test_what_is_written_is_read_back_with_name_and_second_interval(path: Path) -> None:
    tag = made.tag(
        4, 148_712_345.678, 1.333, 2.0, pulse_width_s=0.015, name="Lüna of\nthe marsh"
    )
    config = detector_config(tag, 148.7e6, "/logs")
    write_detector_config(path, config, TIME_NS)
    read = read_detector_config(path)
    assert read.tag.name == "Lüna of the marsh"
    assert read.tag.pulse_intervals_s == (1.333, 2.0)
    assert read.tag.frequency_hz == 148_712_345.678
    assert read.channel_center_frequency_hz == config.channel_center_frequency_hz
    assert read.data_port == config.data_port


def test_the_last_record_of_an_original_file_counts(path: Path) -> None:
    record = (
        "ID:\t{}\nchannelCenterFreqMHz:\t150.0\nFs:\t3840\ntagFreqMHz:\t150.001\ntp:\t0.02\n"
    )
    path.write_text(
        "#####\n"
        + record.format(1)
        + "tip:\t1\n#####\n"
        + record.format(6)
        + "tip:\t2.0\n###\n"
    )
    read = read_detector_config(path)
    assert read.tag.tag_id == 6
    assert read.tag.pulse_intervals_s == (2.0,)
    assert read.sample_rate_hz == 3840.0


@pytest.mark.parametrize(
    "mode",
    ["freqSearchHardLock", "freqSearchSoftLock", "freqKnownHardLock", "freqAllNeverLock"],
)
def test_mode_and_excluded_stretches_are_written_and_read(path: Path, mode: str) -> None:
    excluded = ((-1200.0, -1100.5), (0.0, 10.0))
    config = replace(
        detector_config(TAG, 148.7e6, "/logs", operating_mode=mode), excluded_hz=excluded
    )
    write_detector_config(path, config, TIME_NS)
    assert original_reader(path.read_text())["excldFreqs"] == "[-1200.0, -1100.5; 0.0, 10.0]"
    assert read_detector_config(path) == config


def test_no_excluded_stretch_is_read_as_none(path: Path) -> None:
    write_detector_config(path, detector_config(TAG, 148.7e6), TIME_NS)
    assert "excldFreqs:\t[Inf, -Inf]\n" in path.read_text()
    assert read_detector_config(path).excluded_hz == ()


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("Fs", "nan", "Fs is nan, but must be 1 to 100000000"),
        ("Fs", "0", "Fs is 0"),
        ("tp", "-0.02", r"tp is -0.02, but must be 0.001 to 1 \(seconds\)"),
        ("tp", "20", "tp is 20"),
        ("tip", "inf", "tip is inf"),
        ("tip2", "0", "tip2 is 0"),
        ("tipu", "0.7", r"tipu is 0.7, but must be under half of tip \(1.254"),
        ("tipj", "-1", "tipj is -1"),
        ("K", "0", "K is 0, but must be 1 to 100"),
        ("falseAlarmProb", "1", "falseAlarmProb is 1, but must lie between 0 and 1"),
        ("falseAlarmProb", "nan", "falseAlarmProb is nan"),
        ("tagFreqMHz", "148710000", "tagFreqMHz is 148710000, but must be 20 to 1000"),
        ("channelCenterFreqMHz", "nan", "channelCenterFreqMHz is nan"),
        ("portData", "-5", "portData is -5"),
        ("excldFreqs", "[-1300; -700]", r"excldFreqs is \[-1300; -700\], but must be pairs"),
        ("excldFreqs", "[-700, -1300]", "the lower first"),
        ("excldFreqs", "[nan, 3]", "pairs"),
        ("excldFreqs", "[low, high]", "pairs"),
    ],
)
def test_a_number_that_cannot_be_is_refused_by_its_key(
    path: Path, key: str, value: str, says: str
) -> None:
    write_detector_config(path, detector_config(TAG, 148.7e6), TIME_NS)
    lines = [line for line in path.read_text().splitlines() if not line.startswith(f"{key}:")]
    path.write_text("\n".join([*lines, f"{key}:\t{value}"]) + "\n")
    with pytest.raises(FormatError, match=says):
        read_detector_config(path)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (
            "ID:\t2\nchannelCenterFreqMHz:\t1\ntip:\t1\nFs:\t1\ntagFreqMHz:\t1\ntp:\t1\n"
            "excldFreqs:\t[1, 2, 3]\n",
            "is not a detectorConfig.txt",
        ),
        ("", "lacks the key"),
        ("ID:\t2\n", "lacks the key tip"),
        ("ID:\tx\ntip:\t1\nFs:\t1\ntagFreqMHz:\t1\ntp:\t1\n", "is not a detectorConfig.txt"),
        ("ID:\t2\ntip:\t1\nFs:\t1\ntagFreqMHz:\tinf\ntp:\t1\n", "is not a detectorConfig.txt"),
    ],
)
def test_what_is_no_config_is_refused(path: Path, text: str, word: str) -> None:
    path.write_text(text)
    with pytest.raises(FormatError, match=word):
        read_detector_config(path)


def test_a_missing_config_is_refused_with_its_name(path: Path) -> None:
    with pytest.raises(FormatError, match="detectorConfig"):
        read_detector_config(path)
