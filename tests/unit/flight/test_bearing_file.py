"""What is no bearing in a file of bearings is refused with its line."""

from pathlib import Path

import pytest

from uavrt.core.errors import FormatError
from uavrt.formats.bearings_csv import read_bearing_file

HEADING = "tag_id,latitude_deg,longitude_deg,bearing_deg,time_utc,sigma_deg\n"


@pytest.mark.parametrize("wrong", ["1e300", "-1e300", "-1", "1e12", "-9e18", "4611686019"])
@pytest.mark.parametrize("column", ["start", "end"])
def test_times_before_1970_or_after_2116_are_refused(
    tmp_path: Path, wrong: str, column: str
) -> None:
    times = (wrong, "1700000060") if column == "start" else ("1700000000", wrong)
    path = tmp_path / "bearings.csv"
    path.write_text(f"# a comment\n2,a.csv,92.5,0.9,47.4,8.5,40.0,500.0,{','.join(times)}\n")
    with pytest.raises(FormatError, match=rf"line 2: {wrong} is not a time"):
        read_bearing_file(path)


@pytest.mark.parametrize("wrong", ["1969-12-31T23:59:59Z", "noon"])
def test_noted_times_before_1970_or_undated_are_refused(tmp_path: Path, wrong: str) -> None:
    path = tmp_path / "noted.csv"
    path.write_text(f"{HEADING}2,47.4,8.5,92.5,{wrong},4\n")
    with pytest.raises(FormatError, match="line 2"):
        read_bearing_file(path)


@pytest.mark.parametrize("wrong", ["0", "-3", "0.0"])
def test_a_standard_deviation_of_zero_or_less_is_refused(tmp_path: Path, wrong: str) -> None:
    for name, text in (
        ("noted.csv", f"{HEADING}2,47.4,8.5,92.5,,{wrong}\n"),
        ("bearings.csv", f"\n2,a.csv,92.5,0.9,47.4,8.5,40.0,500.0,1.7e9,1.7e9,{wrong}\n"),
    ):
        path = tmp_path / name
        path.write_text(text)
        with pytest.raises(FormatError, match=f"line 2: {wrong} is not a standard deviation"):
            read_bearing_file(path)


def test_what_is_not_known_is_none_and_times_keep_their_digits(tmp_path: Path) -> None:
    path = tmp_path / "bearings.csv"
    path.write_text("2,a.csv,92.5,nan,47.4,8.5,,500.0,1700000000.123456,inf,nan\n")
    (row,) = read_bearing_file(path)
    assert (row.start_time_ns, row.end_time_ns) == (1_700_000_000_123_456_000, None)
    assert row.confidence is row.sigma_deg is row.altitude_relative_m is None
