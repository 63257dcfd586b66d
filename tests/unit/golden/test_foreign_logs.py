"""Lines of other systems' logs, as their programs write them."""

import io
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from some import some

from uavrt.core.earth.attitude import from_euler_deg, yaw_deg
from uavrt.core.errors import FormatError
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.reading.recognise import read_pulse_log, read_pulses, recognised
from uavrt.formats.bearings_csv import (
    read_bearing_file,
    write_bearing_file,
)
from uavrt.formats.positions_csv import (
    PositionRow,
    read_position_file,
    write_position_file,
)
from uavrt.formats.pulses.tagtracker import write_tagtracker
from uavrt.formats.pulses.ucsd import read_ucsd_estimates

# A heading east by 91°: the quaternion of the thesis's Fig. 5.7.
QUATERNION = "0.00189066, -0.00109068, 0.71339, 0.700764"
ROW_2023 = (
    "7,2,148710225,1684766889.853803,1684766891.062759,36.843531,2.749993,13,1,36.563833,1,1,"
    "35.178241,-111.656588,9.693001,"
)
MARK = "10,35.178241,-111.656587,2107.371582"
ROW_2024 = (
    "7, 2, 148710000, 1700205421.743562, 1700205422.947562, 70.218000, 0.250311, 12, 3, "
    "69.825300, 1e-10, 2, 1, 47.397800, 8.545610, 12.500000, "
)
ROW_20 = (
    "20, 5, 3, 2, 148710012, 40, 1790000000.250000, 1790000001.504000, 12.5, 1.31, 2e-12, "
    "1.1e-13, 2, 1, 2, 1, 35.178241, -111.656588, 30.1, 0.5, -1.5, 45.0, 90.0"
)
EULER_HEADING = (
    "# 7, tag_id, frequency_hz, start_time_seconds, predict_next_start_seconds, snr, "
    "stft_score, group_seq_counter, group_ind, group_snr, noise_psd, detection_status, "
    "confirmed_status, latitude, longitude, altitude_rel, roll_deg, pitch_deg, yaw_deg, "
    "antenna_offset"
)
QUATERNION_HEADING = (
    "# 1, tag_id, frequency_hz, start_time_seconds, predict_next_start_seconds, snr, "
    "stft_score, group_ind, group_snr, noise_psd, detection_status, confirmed_status, "
    "position_x, position_y, position_z, orientation_x, orientation_y, orientation_z, "
    "orientation_w, antenna_offset"
)


def log(tmp_path: Path, *lines: str, name: str = "Pulse-2023-05-22-07-48-09-123.csv") -> Path:
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "lines",
    [
        (ROW_2023 + QUATERNION.replace(" ", ""),),
        (ROW_2023 + QUATERNION.replace(" ", "") + ",",),
        (ROW_2023 + QUATERNION.replace(" ", "") + ",0.0",),
        (QUATERNION_HEADING, MARK, ROW_2023 + QUATERNION, MARK.replace("10,", "11,")),
        (MARK + "," * 17, ROW_2023 + QUATERNION + ", 0.0,"),
        (MARK + ",NaN" * 17, ROW_2023 + QUATERNION + ", 0.0, NaN"),
        (MARK + ",0" * 17, ROW_2023 + QUATERNION + ",, 0.0"),
        (MARK + ", " * 17, ROW_2023 + QUATERNION + ", NaN, NaN"),
        ("cmd, tag_id, frequency_hz", ROW_2023.replace("7", "7.000000", 1) + QUATERNION),
    ],
    ids=[
        *("no heading, 19", "empty 20th", "20 with offset", "heading and marks"),
        *("21, the last empty", "padded with NaN", "offset in the 21st", "padded with blanks"),
        "a table's numbers",
    ],
)
def test_every_variant_of_2023_says_the_same(tmp_path: Path, lines: tuple[str, ...]) -> None:
    found = read_pulse_log(log(tmp_path, *lines))
    (one,) = found.pulse_poses
    assert found.kind == "tagtracker"
    assert one.pulse.start_time_ns == 1_684_766_889_853_803_000
    assert one.pulse.predicted_next_start_ns == 1_684_766_891_062_759_000
    assert (one.pulse.tag_id, one.pulse.frequency_hz) == (2, 148_710_225.0)
    assert (one.pulse.snr_db, one.pulse.group_snr_db) == (36.843531, 36.563833)
    assert (one.pulse.group_sequence, one.pulse.group_index) == (13, 1)
    assert math.isnan(one.pulse.noise_psd)
    pose = some(one.pose)
    assert (pose.latitude_deg, pose.longitude_deg) == (35.178241, -111.656588)
    assert pose.altitude_relative_m == 9.693001
    assert yaw_deg(pose.quaternion_wxyz) == pytest.approx(91.0, abs=0.05)
    assert any("half of each turn" in warning for warning in found.warnings)


@pytest.mark.parametrize(
    ("heading", "attitude"),
    [
        ((), "0.100000, -0.200000, 91.000000, 0.000000"),
        ((EULER_HEADING,), "0.100000, -0.200000, 91.000000, 0.000000"),
        ((), QUATERNION),
        ((QUATERNION_HEADING,), QUATERNION + ", 0.0"),
        ((), QUATERNION + ", 0"),
    ],
    ids=["Euler", "Euler, heading", "20 quaternion", "21, heading", "21"],
)
def test_every_variant_with_a_noise_density_says_the_same(
    tmp_path: Path, heading: tuple[str, ...], attitude: str
) -> None:
    (one,) = read_pulses(log(tmp_path, *heading, ROW_2024 + attitude))
    assert one.pulse.noise_psd == 1e-10
    assert one.pulse.detection_status == "confirmed"
    pose = some(one.pose)
    assert (pose.latitude_deg, pose.longitude_deg) == (47.3978, 8.54561)
    assert pose.altitude_relative_m == 12.5
    assert yaw_deg(pose.quaternion_wxyz) == pytest.approx(91.0, abs=0.05)


def test_the_antennas_offset_turns_the_heading_once(tmp_path: Path) -> None:
    (one,) = read_pulses(log(tmp_path, ROW_2024 + "0, 0, 91.0, 90.0"))
    assert yaw_deg(some(one.pose).quaternion_wxyz) == pytest.approx(181.0)


def test_rows_of_2026_and_slices_with_nothing_found(tmp_path: Path) -> None:
    nothing = ROW_20.replace("1.1e-13, 2, 1,", "1.1e-13, 3, 0,").replace("12.5,", "-9999,")
    found = read_pulse_log(log(tmp_path, ROW_20, nothing, MARK))
    (one,) = found.pulse_poses
    assert found.passed_over == 1
    assert found.marks[0].before_pulse == 1
    assert (one.pulse.group_sequence, one.pulse.rate) == (40, 2)
    assert one.pulse.start_time_ns == 1_790_000_000_250_000_000
    assert yaw_deg(some(one.pose).quaternion_wxyz) == pytest.approx(135.0, abs=0.1)


def test_minus_infinity_is_kept_and_the_placeholder_is_unknown(tmp_path: Path) -> None:
    attitude = "0.1, -0.2, 91.0, 0.0"
    lines = [ROW_2024.replace("70.218000", snr) + attitude for snr in ("-inf", "-9999")]
    found = read_pulses(log(tmp_path, *lines))
    assert found[0].pulse.snr_db == -math.inf
    assert math.isnan(found[1].pulse.snr_db)


def test_times_with_six_digits_are_read_with_a_warning(tmp_path: Path) -> None:
    row = ROW_2023.replace("1684766889.853803", "1.68477e+09") + QUATERNION
    found = read_pulse_log(log(tmp_path, *[row] * 5))
    assert found.pulse_poses[0].pulse.start_time_ns == 1_684_770_000_000_000_000
    assert any("rounded" in warning for warning in found.warnings)


def test_a_line_cut_off_at_the_end_loses_only_itself(tmp_path: Path) -> None:
    path = log(tmp_path, ROW_2024 + QUATERNION)
    with path.open("a") as file:
        file.write(ROW_2024[:40])
    assert len(read_pulses(path)) == 1


def test_a_wrong_line_is_named(tmp_path: Path) -> None:
    good = ROW_2024 + "0.1, -0.2, 91.0, 0.0"
    wrong = good.replace("148710000", "many")
    with pytest.raises(FormatError, match=r"line 3: .*many"):
        read_pulses(log(tmp_path, EULER_HEADING, good, wrong, good))


def test_what_we_write_for_tagtracker_is_read_back(tmp_path: Path) -> None:
    ours = read_pulses(log(tmp_path, ROW_2024 + "3.0, -4.0, 91.0, 0.0"))
    stream = io.StringIO()
    write_tagtracker(stream, ours)
    assert stream.getvalue().startswith("# 7, tag_id")
    again = read_pulses(log(tmp_path, *stream.getvalue().splitlines(), name="again.csv"))
    assert again[0].pulse == ours[0].pulse
    expected = from_euler_deg(91.0, -4.0, 3.0)
    assert some(again[0].pose).quaternion_wxyz == pytest.approx(expected, abs=1e-6)


def test_the_log_of_the_original_is_read_with_the_reason_why_its_poses_are_unusable(
    tmp_path: Path,
) -> None:
    line = (
        "2, 148.71, 1700205419, 230494976, 1700205419, 250494957, 1700205420, 434494972, "
        "1700205420, 4294967295, 69.6484, 0.219541, 1, 69.8253, 1, 1, 47.3978, 8.54561, "
        "488.077, " + QUATERNION
    )
    directory = tmp_path / "flight_log_2023-04-06_10-46-01/detector_log/tag_id_2/output"
    directory.mkdir(parents=True)
    log(directory, line, name="pulse_pose_log.txt")
    found = read_pulse_log(tmp_path / "flight_log_2023-04-06_10-46-01")
    assert found.kind == "pulse_pose_log"
    assert len(found.pulse_poses) == 1
    assert "half-way" in found.warnings[0]
    assert "11 m" in found.warnings[1]


def test_a_tag_called_20_is_not_taken_for_a_row_20(tmp_path: Path) -> None:
    line = (
        "20, 148.710000000, 1700205419, 230494976, 1700205419, 250494957, 1700205420, "
        "434494972, 1700205420, 554494972, 69.6484, 0.219541, 1, 69.8253, 1, 1, 47.397800000, "
        "8.545610000, 488.077, " + QUATERNION
    )
    found = read_pulse_log(log(tmp_path, line, name="pulse_pose_log.txt"))
    assert found.kind == "pulse_pose_log"
    assert found.warnings == ()
    assert found.pulse_poses[0].pulse.tag_id == 20


def test_pings_of_ucsd_have_places_from_utm(tmp_path: Path) -> None:
    # The CN Tower: 43°38'33.24" N, 79°23'13.7" W is 17N 630084 4833438 (Wikipedia, UTM).
    path = log(
        tmp_path,
        "Run,Timestamp,Frequency,Amplitude,Easting,Northing,Altitude,Heading,EPSG Code",
        "1,1700000000.5,173500000,-42.5,630084,4833438,120.0,45.0,32617",
        "1,1700000002000,173964000,-40.0,630084,4833438,120.0,50.0,32617",
        name="pings.csv",
    )
    found = read_pulse_log(path)
    first, second = found.pulse_poses
    assert (first.pulse.tag_id, second.pulse.tag_id) == (1, 2)
    assert second.pulse.start_time_ns - first.pulse.start_time_ns == 1_500_000_000
    pose = some(first.pose)
    assert pose.latitude_deg == pytest.approx(43.642567, abs=1e-5)
    assert pose.longitude_deg == pytest.approx(-79.387139, abs=1e-5)
    assert yaw_deg(pose.quaternion_wxyz) == pytest.approx(45.0)
    assert "unknown reference" in found.warnings[0]


def test_estimates_of_ucsd_have_places(tmp_path: Path) -> None:
    path = log(
        tmp_path,
        "Run,Timestamp,Frequency,Easting,Northing,EPSG Code",
        "1,2023-11-17T07:16:59Z,173500000,500000,10000000,32731",
        name="estimates.csv",
    )
    (estimate,) = read_ucsd_estimates(path)
    assert estimate.latitude_deg == pytest.approx(0.0, abs=1e-9)
    assert estimate.longitude_deg == pytest.approx(3.0)
    assert estimate.time_ns == 1_700_205_419_000_000_000


def test_signals_of_pyradiotracking_have_no_place(tmp_path: Path) -> None:
    path = log(
        tmp_path,
        "Device;Time;Frequency;Duration;max (dBW);avg (dBW);std (dB);noise (dBW);snr (dB)",
        "0;2021-06-01T12:00:00.123456;150172000.0;0.0205;-62.1;-64.0;1.2;-90.5;26.5",
        "1;2021-06-01 12:00:01.5+00:00;150172500.0;0:00:00.019;-60;-62;1.1;-91;29",
        name="signals.csv",
    )
    found = read_pulse_log(path)
    first, second = (one.pulse for one in found.pulse_poses)
    assert (first.snr_db, second.tag_id) == (26.5, 1)
    assert first.end_time_ns - first.start_time_ns == 20_500_000
    assert second.end_time_ns - second.start_time_ns == 19_000_000
    assert all(one.pose is None for one in found.pulse_poses)
    assert any("2 receivers" in warning for warning in found.warnings)


def test_the_golden_bearing_line_survives_and_a_new_one_replaces_its_parents(
    tmp_path: Path,
) -> None:
    golden = (
        "2,rotation_example.csv,137.592747,0.061582,35.178241,-111.656587,9.569501,"
        "2107.248081,1684766889.853803,1684767153.888881\n"
    )
    path = tmp_path / "bearings.csv"
    path.write_text(golden)
    (row,) = read_bearing_file(path)
    unknown: dict[str, Any] = dict.fromkeys(
        ("confidence", "altitude_relative_m", "altitude_amsl_m", "start_time_ns", "end_time_ns")
    )
    other = replace(row, parent_file="other.csv", bearing_deg=10.0, sigma_deg=2.5, **unknown)
    write_bearing_file(path, [other])
    assert read_bearing_file(path) == (row, other)
    write_bearing_file(path, [row])
    assert read_bearing_file(path) == (other, row)
    assert golden.split(",")[2:4] == path.read_text().splitlines()[1].split(",")[2:4]


def test_positions_are_written_as_the_original_does_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "positions.csv"
    mle, mest = (35.17, -111.65), (35.171234567, -111.651234567)
    row = PositionRow(tag_id=2, bearing_file="bearings.csv", mle=mle, rmr=None, mest=mest)
    write_position_file(path, [row])
    write_position_file(path, [row])
    assert read_position_file(path) == (row,)
    assert path.read_text().endswith(",\n")
    assert path.read_text().count(",") == 8


def test_our_own_files_are_recognised(tmp_path: Path) -> None:
    path = log(tmp_path, '{"tag_id": 2}', name="p.jsonl")
    assert recognised(path) == "uavrt-jsonl"
    with pytest.raises(FormatError, match="line 1"):
        read_pulse_file(path)
    with pytest.raises(FormatError, match="not a known pulse log"):
        recognised(log(tmp_path, "Lorem ipsum", "dolor", name="text.txt"))
