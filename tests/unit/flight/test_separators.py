"""Tables that a spreadsheet saved are read: semicolons, tabs, decimal commas, filled rows."""

import re
from pathlib import Path

import numbered
import pytest

from uavrt.core.messages import PulsePose
from uavrt.flight.logs.pulse_pose_log import format_line
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.formats.bearings_csv import read_bearing_file
from uavrt.formats.pulses.tagtracker import write_tagtracker

SAVED = pytest.mark.parametrize(
    ("separator", "decimal"), [(";", "."), (";", ","), ("\t", "."), ("\t", ",")]
)


def saved(text: str, separator: str, decimal: str) -> str:
    """A table as a spreadsheet saves it."""
    apart = text.replace(", ", ",").replace(",", separator)
    return re.sub(r"(\d)\.(\d)", rf"\1{decimal}\2", apart)


@SAVED
def test_tagtracker_with_any_separator_is_read(
    tmp_path: Path, separator: str, decimal: str
) -> None:
    pulses: list[PulsePose] = [numbered.pulse_pose(n, 2) for n in range(12)]
    path = tmp_path / "Pulse-1.csv"
    with path.open("w", encoding="utf-8") as stream:
        write_tagtracker(stream, pulses)
    plain = read_pulse_log(path)
    head, _, rows = path.read_text(encoding="utf-8").partition("\n")
    for heading in ("", f"{head}\n", saved(f"{head}\n", separator, ".")):
        path.write_text(heading + saved(rows, separator, decimal), encoding="utf-8")
        found = read_pulse_log(path)
        assert found.kind == "tagtracker"
        assert found.pulse_poses == plain.pulse_poses


@SAVED
def test_bearings_with_any_separator_are_read(
    tmp_path: Path, separator: str, decimal: str
) -> None:
    text = "2,a.csv,92.5,0.9,47.4,8.496688,40.0,500.0,1700000000.5,1700000060.5,2.0\n"
    path = tmp_path / "bearings.csv"
    path.write_text(text, encoding="utf-8")
    plain = read_bearing_file(path)
    path.write_text(saved(text, separator, decimal).replace(f"a{decimal}csv", "a.csv"))
    assert read_bearing_file(path) == plain


def test_a_pulse_pose_log_whose_lines_end_with_commas_is_read(tmp_path: Path) -> None:
    pulses: list[PulsePose] = [numbered.pulse_pose(n, 2) for n in range(5)]
    lines = [format_line(one).rstrip("\n") for one in pulses]
    path = tmp_path / "pulse_pose_log.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    plain = read_pulse_log(path).pulse_poses
    path.write_text("\n".join(f"{one},,," for one in lines) + "\n", encoding="utf-8")
    assert read_pulse_log(path).pulse_poses == plain


def test_pings_without_height_and_heading_are_read(tmp_path: Path) -> None:
    path = tmp_path / "pings.csv"
    path.write_text(
        "Run,Timestamp,Frequency,Amplitude,Easting,Northing,Altitude,Heading,EPSG Code\n"
        "1,1700000000.0,172464000,-67.1,462300.0,5249900.0,,,32632\n"
        "1,1700000001.5,172464000,-68.2,462300.0,5249909.0,,,32632\n"
    )
    found = read_pulse_log(path)
    assert found.kind == "ucsd"
    assert len(found.pulse_poses) == 2
    assert all(one.pose is not None for one in found.pulse_poses)
