"""Logs whose places are none or unknown, logs in folders: what is read, and what is told."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numbered
import pytest
from some import some

from uavrt.analysis.tracks.recognised import read_track
from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose
from uavrt.flight.logs.pulse_files import PulseWriter, pulse_format
from uavrt.flight.logs.pulse_pose_log import format_line
from uavrt.flight.reading.recognise import pulse_logs_in, read_pulse_log
from uavrt.formats.pulses.tagtracker import write_tagtracker

NAMES = ("pulses.jsonl", "pulses.csv", "pulse_pose_log.txt", "Pulse-1.csv")


def write(path: Path, pulses: list[PulsePose]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as stream:
        if path.suffix == ".txt":
            stream.writelines(map(format_line, pulses))
        elif path.name.startswith("Pulse-"):
            write_tagtracker(stream, pulses)
        else:
            writer = PulseWriter(stream, pulse_format(path.name))
            for one in pulses:
                writer.write(one)
    return path


def moved(one: PulsePose, **changes: object) -> PulsePose:
    return replace(one, pose=replace(some(one.pose), **changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("latitude", "longitude", "remedy"),
    [(-111.6565, 35.1782, "swapped"), (351782410.0, -1116565870.0, "ten million")],
)
def test_a_log_of_places_off_the_globe_is_refused_with_what_it_may_be(
    tmp_path: Path, name: str, latitude: float, longitude: float, remedy: str
) -> None:
    wrong = [
        moved(numbered.pulse_pose(number), latitude_deg=latitude, longitude_deg=longitude)
        for number in range(3)
    ]
    with pytest.raises(FormatError, match="is not a latitude") as refused:
        read_pulse_log(write(tmp_path / name, wrong))
    assert remedy in str(refused.value)
    assert " line " in str(refused.value)


@pytest.mark.parametrize("name", NAMES[:3])
def test_one_place_off_the_globe_is_passed_over_and_told_once(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pulses = [numbered.pulse_pose(number) for number in range(4)]
    wrong = [*pulses[:2], moved(pulses[2], longitude_deg=1116565870.0), pulses[3]]
    log = read_pulse_log(write(tmp_path / name, wrong))
    assert len(log.pulse_poses) == 3
    (told,) = [text for text in log.warnings if "skipped" in text]
    line = 4 if name.endswith(".csv") else 3
    assert f"1 damaged line was skipped (line {line}: 1116565870 is not" in told
    assert "ten million" in told
    assert capsys.readouterr().err == ""  # no line of the program's log on the terminal


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("field", ["latitude_deg", "longitude_deg", "quaternion_wxyz"])
def test_what_is_not_a_number_is_absence(tmp_path: Path, name: str, field: str) -> None:
    pulses = [numbered.pulse_pose(number) for number in range(4)]
    path = write(tmp_path / name, pulses)
    lines = path.read_text().splitlines()
    pose = some(pulses[2].pose)
    row = next(number for number, line in enumerate(lines) if line[0] in "{27") + 2
    if name.endswith("jsonl"):
        value = [0, 0, 0, 0] if field == "quaternion_wxyz" else math.nan
        lines[row] = json.dumps(json.loads(lines[row]) | {field: value})
    elif field == "quaternion_wxyz" and name == "pulses.csv":
        lines[row] = lines[row].replace(" ".join(map(repr, pose.quaternion_wxyz)), "0 0 0 0")
    elif field == "quaternion_wxyz":
        cells = lines[row].split(", ")
        first = 19 if name.endswith("txt") else 16
        cells[first : first + 3] = ["nan"] * 3
        lines[row] = ", ".join(cells)
    else:
        text = "47.3978" if field == "latitude_deg" else "8.5456"
        cells = lines[row].split(",")
        at = next(n for n, cell in enumerate(cells) if cell.strip().startswith(text))
        cells[at] = "nan"
        lines[row] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    read = read_pulse_log(path).pulse_poses
    assert [one.pose is None for one in read] == [False, False, True, False]


def test_an_unknown_frequency_is_written_for_tagtracker_as_none(tmp_path: Path) -> None:
    one = numbered.pulse_pose()
    unknown = replace(one, pulse=replace(one.pulse, frequency_hz=math.nan))
    path = write(tmp_path / "Pulse-1.csv", [unknown, one])
    first, second = read_pulse_log(path).pulse_poses
    assert math.isnan(first.pulse.frequency_hz)
    assert second.pulse.frequency_hz == 148_710_000.0


@pytest.mark.parametrize("name", NAMES[:3])
def test_a_spreadsheets_byte_order_and_line_ends_are_read(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / name, [numbered.pulse_pose(number) for number in range(3)])
    plain = read_pulse_log(path).pulse_poses
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert read_pulse_log(path).pulse_poses == plain
    assert len(plain) == 3


def test_flights_and_logs_are_found_in_a_folder_at_any_depth(tmp_path: Path) -> None:
    pulses = [numbered.pulse_pose()]
    logs = [
        write(tmp_path / "a/nan.csv", pulses),
        write(tmp_path / "a/placed0.jsonl", pulses),
        write(tmp_path / "b/2026/flight_2/pulse_pose_log.txt", pulses).parent,
        write(tmp_path / "c.csv", pulses),
    ]
    flight = tmp_path / "d/e/flight_1"
    flight.mkdir(parents=True)
    (flight / "flight.sqlite").touch()
    (flight / "events.jsonl").write_text('{"event": "start"}\n')
    # What lies beside them is none.
    (tmp_path / "a/notes.txt").write_text("2 tags\n")
    (tmp_path / "a/empty.csv").touch()
    (tmp_path / "a/bearings.csv").write_text("tag_id,parent_file,bearing_deg\n2,x,10\n")
    (tmp_path / "a/telemetry.csv").write_text("time_ns,latitude_deg\n1,2\n")
    assert pulse_logs_in(tmp_path) == (*logs, flight)
    (tmp_path / "d/nothing").mkdir()
    with pytest.raises(FormatError, match="contains no flight and no pulse log"):
        pulse_logs_in(tmp_path / "d/nothing")


@pytest.mark.parametrize(
    "text",
    [
        '{"type": "FeatureCollection", "features": [{"properties": {"tag_id": 2}}]}',
        '{\n  "tag_id": 2\n}\n',
        "tag_id,time,bearing_deg\n",
    ],
)
def test_what_is_no_pulse_log_is_said_to_be_none(tmp_path: Path, text: str) -> None:
    path = tmp_path / "flight.geojson"
    path.write_text(text)
    with pytest.raises(FormatError, match="is not a known pulse log format"):
        read_pulse_log(path)


TELEMETRY = "time_ns,latitude_deg,longitude_deg,altitude_amsl_m,altitude_relative_m,qw,qx,qy,qz"
GPX = "<gpx><trk><trkseg>{}</trkseg></trk></gpx>"


def gpx_point(second: int, latitude: float, longitude: float) -> str:
    time = f"2024-05-01T10:00:{second:02d}Z"
    return f'<trkpt lat="{latitude}" lon="{longitude}"><time>{time}</time></trkpt>'


def test_tracks_off_the_globe_are_refused_and_unknown_places_left_out(tmp_path: Path) -> None:
    poses = tmp_path / "telemetry.csv"
    row = "{},{},{},500,20,1,0,0,0"
    rows = [row.format(10**18 + n, 35.1, -111.6) for n in range(3)]
    poses.write_text("\n".join([TELEMETRY, *rows, row.format(10**18 + 5, "nan", -111.6)]))
    assert len(read_track(poses).positions) == 3
    poses.write_text("\n".join([TELEMETRY, *rows, row.format(10**18 + 5, -111.6, 35.1)]))
    with pytest.raises(FormatError, match=r"line 5: -111\.6 is not a latitude.*swapped"):
        read_track(poses)
    path = tmp_path / "track.gpx"
    good = "".join(gpx_point(n, 35.1 + n * 1e-4, -111.6) for n in range(3))
    path.write_text(GPX.format(good + gpx_point(4, -111.6, 35.1)))
    track = read_track(path)
    assert "1 point of" in track.warnings[0]
    assert min(one.latitude_deg for one in track.positions) > 35.0
    path.write_text(GPX.format("".join(gpx_point(n, -111.6, 35.1) for n in range(3))))
    with pytest.raises(FormatError, match=r"point 1: -111\.6 is not a latitude.*swapped"):
        read_track(path)
