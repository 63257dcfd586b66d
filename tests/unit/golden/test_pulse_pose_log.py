"""Lines of ``pulse_pose_log.txt``: the thesis's own, and ours beside them."""

import json
from dataclasses import replace
from pathlib import Path

import numbered
import pytest
from some import some

from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose
from uavrt.flight.logs.pulse_pose_log import (
    READ_BYTES,
    PulsePoseLog,
    format_line,
    parse_line,
    read_pulse_pose_log,
)

# Thesis, Fig. 5.7, row 1: six digits, and a saturated column 10.
THESIS_ROW = (
    "2, 148.71, 1700205419, 230494976, 1700205419, 250494957, 1700205420, 434494972, "
    "1700205420, 4294967295, 69.6484, 0.219541, 1, 69.8253, 1, 1, 47.3978, 8.54561, 488.077, "
    "0.00189066, -0.00109068, 0.71339, 0.700764\n"
)
OUR_ROW = (
    "2, 148.710000125, 1700205419, 230494976, 1700205419, 250494957, 1700205420, 434494972, "
    "1700205420, 554494972, 69.64840000001, 0.219541, 1, 69.8253, 1, 1, 47.397812345, "
    "8.545611234, 488.0771, 0.001890660, -0.001090680, 0.713390000, 0.700764000\n"
)
PULSE = replace(
    numbered.pulse(),
    start_time_ns=numbered.START_NS,
    end_time_ns=1_700_205_419_250_494_957,
    snr_db=69.64840000001,
    group_sequence=7,
    predicted_next_start_ns=1_700_205_420_434_494_972,
    predicted_next_end_ns=1_700_205_420_554_494_972,
)
POSE = numbered.pose(1_700_205_419_240_494_966)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "pulse_pose_log.txt"


def test_our_line_has_the_thesis_columns_at_full_precision() -> None:
    assert format_line(PulsePose(pulse=PULSE, pose=POSE)) == OUR_ROW
    assert len(OUR_ROW.split(", ")) == len(THESIS_ROW.split(", ")) == 23
    assert some(parse_line(OUR_ROW).pose).time_ns == POSE.time_ns


def test_the_thesis_line_is_read_as_its_author_meant_it() -> None:
    row = parse_line(THESIS_ROW)
    assert row.pulse.frequency_hz == 148_710_000.0
    assert row.pulse.start_time_ns == 1_700_205_419_230_494_976
    assert row.pulse.predicted_next_start_ns == 1_700_205_420_434_494_972
    assert row.pulse.predicted_next_end_ns is None  # saturated, so unknown
    assert row.pulse.detection_status == "confirmed"
    pose = some(row.pose)
    assert pose.latitude_deg == 47.3978
    assert yaw_deg(pose.quaternion_wxyz) == pytest.approx(91.0, abs=0.05)


def test_a_pulse_without_pose_has_nan_and_never_zeros() -> None:
    line = format_line(PulsePose(pulse=PULSE, pose=None))
    assert line.endswith(", nan" * 7 + "\n")
    assert parse_line(line).pose is None


def test_the_thesis_word_for_no_telemetry_is_no_pose() -> None:
    fields = THESIS_ROW.split(", ")
    assert parse_line(", ".join(fields[:16] + ["0"] * 7)).pose is None


@pytest.mark.parametrize(
    ("detection", "confirmed", "status"),
    [("0", "0", "subthreshold"), ("0", "1", "subthreshold"), ("1", "0", "detected")],
)
def test_both_flags_together_tell_the_status(
    detection: str, confirmed: str, status: str
) -> None:
    fields = THESIS_ROW.split(", ")
    fields[14:16] = [detection, confirmed]
    pulse = parse_line(", ".join(fields)).pulse
    assert pulse.detection_status == status
    assert pulse.confirmed == (confirmed == "1")
    line = format_line(PulsePose(pulse=pulse, pose=None))
    assert line.split(", ")[14:16] == [detection, confirmed]


def test_groups_are_counted_again_from_the_place_in_the_group(path: Path) -> None:
    fields = THESIS_ROW.split(", ")
    for place in ("1", "2", "3", "1", "3", "2"):
        fields[12] = place
        with path.open("a") as file:
            file.write(", ".join(fields))
    groups = [one.pulse.group_sequence for one in read_pulse_pose_log(path)]
    assert groups == [1, 1, 1, 2, 2, 3]


@pytest.mark.parametrize("tail", ["2, 148.71, 17002", "\0" * 30, "2, 148.71, 17002\n"])
def test_a_line_cut_off_by_a_power_cut_is_passed_over(path: Path, tail: str) -> None:
    path.write_text(THESIS_ROW * 2 + tail)
    assert len(read_pulse_pose_log(path)) == 2


def test_a_damaged_line_inside_is_read_around_and_told_with_its_number(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_text(THESIS_ROW + "2, 148.71\n" + THESIS_ROW)
    assert len(read_pulse_pose_log(path)) == 2
    told = json.loads(capsys.readouterr().err)
    assert told["event"] == "damaged lines skipped"
    assert (told["lines"], told["first"]) == (1, 2)
    assert told["reason"] == "the line has 2 columns instead of 23"


def test_a_file_of_damaged_lines_is_no_log(path: Path) -> None:
    path.write_text("2, 148.71\n" + THESIS_ROW + "3, 1\n" * 2)
    with pytest.raises(
        FormatError, match="line 1 is not a pulse: the line has 2 columns instead of 23"
    ):
        read_pulse_pose_log(path)


def test_a_missing_log_is_refused_with_its_name(path: Path) -> None:
    with pytest.raises(FormatError, match="pulse_pose_log"):
        read_pulse_pose_log(path)


def test_repair_finds_the_last_line_however_long_what_follows_it_is(path: Path) -> None:
    log = PulsePoseLog(path)
    for rest in ("x", "x" * READ_BYTES, "x" * (3 * READ_BYTES - len(THESIS_ROW))):
        path.write_text(THESIS_ROW + rest)
        log.repair()
        assert path.read_text() == THESIS_ROW
        path.write_text(rest)
        log.repair()
        assert path.read_text() == ""


def test_repair_cuts_the_unfinished_line_and_tells_what_is_there(path: Path) -> None:
    log = PulsePoseLog(path)
    log.repair()
    assert list(log.keys()) == []
    log.append([THESIS_ROW])
    path.write_text(path.read_text() + OUR_ROW[:60])
    log.repair()
    assert list(log.keys()) == [(2, 1_700_205_419_230_494_976)]
    assert path.read_text() == THESIS_ROW
