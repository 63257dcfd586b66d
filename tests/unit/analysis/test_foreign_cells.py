"""Names and numbers of others: no formula in a table, no half file, no traceback."""

import csv
import io
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from past_flight import TAG, write_flight
from sigmf_meta import write_meta

from uavrt.analysis.measure.bag import export_bag
from uavrt.config.tags.tag_files import parse_tags
from uavrt.config.tags.tag_lists import parse_tag_csv
from uavrt.core.errors import FormatError, TagFileError
from uavrt.formats.csv_line import TableWriter, text_of_cell
from uavrt.ground.store.tag_csv import read_csv
from uavrt.ground.store.tag_table import export_text, rows_from_tags
from uavrt.radio.files.sigmf import sigmf_layout

FORMULAS = ("=1+1", "+cmd|' /C calc'!A0", "-cmd", "@SUM(A1)", "\t=1", '=HYPERLINK("x")')
PLAIN = ("lynx", "-5.25", "+5", "-5.0 1.0", "1e-3", "", "a=b", "o'hara", "'quoted'")


def test_a_text_that_a_spreadsheet_would_run_is_written_as_text_and_read_back() -> None:
    stream = io.StringIO(newline="")
    writer = TableWriter(stream)
    writer.writerow(FORMULAS)
    writer.writerow((*PLAIN, -5.25, None, True))
    first, second = csv.reader(io.StringIO(stream.getvalue(), newline=""))
    assert all(cell.startswith("'") for cell in first)
    assert tuple(map(text_of_cell, first)) == FORMULAS
    assert tuple(second[: len(PLAIN)]) == PLAIN
    assert tuple(map(text_of_cell, second[: len(PLAIN)])) == PLAIN


def test_the_table_of_tags_keeps_names_that_look_like_formulas() -> None:
    tag = replace(TAG, name="=1+1")
    text = export_text((tag,), "tags.csv")
    assert "\n=" not in text
    assert "'=1+1" in text
    (row,) = read_csv(text)
    assert row["name"] == rows_from_tags((tag,))[0]["name"] == "=1+1"


def test_a_flight_that_the_ground_received_is_a_bag(tmp_path: Path) -> None:
    flight = tmp_path / write_flight(tmp_path, 100.0, 200.0)
    bag = export_bag(flight, tmp_path / "bag")
    assert bag.messages["pulse_pose"] == 72
    assert bag.file.stat().st_size > 10_000


def test_a_bag_that_fails_leaves_nothing_in_the_way_of_the_next_try(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = tmp_path / write_flight(tmp_path, 100.0, 200.0)
    with monkeypatch.context() as failing:
        failing.setattr("uavrt.analysis.measure.bag.encode", lambda message: message / 1e6)
        with pytest.raises(
            FormatError, match="has a value that ROS 2 messages cannot represent"
        ):
            export_bag(flight, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()
    assert export_bag(flight, tmp_path / "bag").messages["pulse"] == 72
    shutil.rmtree(tmp_path / "bag")


def test_a_cell_of_200_kb_in_a_list_of_codes_is_a_fault_of_its_line() -> None:
    faults: list[object] = []
    good = "tag_id,frequency_hz,gaps_ms\n"
    parse_tag_csv(f'{good}"{"x" * 200_000},1,2\n', faults)  # type: ignore[arg-type]
    assert "131 072" in str(faults[0])
    with pytest.raises(TagFileError, match="131 072"):
        parse_tags(f'{good}"{"x" * 200_000}",1,2\n'.encode(), name="codes.csv")
    assert read_csv(f'selected,id,name,manufacturerid,freqmhz\n1,1,"{"x" * 200_000}') == []


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("global_index", 2**62),
        ("global_index", 2**50),
        ("datetime", "9999-12-31T23:59:59Z"),
        ("datetime", "0001-01-01T00:00:00Z"),
        ("datetime", "2026-09-01T00:00:00Z"),
    ],
)
def test_a_capture_months_after_the_one_before_is_refused_in_words(
    tmp_path: Path, field: str, value: object
) -> None:
    (tmp_path / "air.sigmf-data").write_bytes(bytes(8 * 2000))
    begun = {"global_index": 0, "datetime": "2026-05-01T00:00:00Z"}
    first = {"frequency": 148.7e6, field: begun[field]}
    second = {"sample_start": 1000, field: value}
    path = write_meta(tmp_path / "air", 1000.0, first, second)
    said = r"air.sigmf-meta: .*(are missing|is not a valid time)"
    with pytest.raises(FormatError, match=said) as refused:
        sigmf_layout(path)
    assert refused.value.remedy


def test_a_gap_of_a_day_is_one(tmp_path: Path) -> None:
    (tmp_path / "air.sigmf-data").write_bytes(bytes(8 * 2000))
    first = {"frequency": 148.7e6, "global_index": 0}
    second = {"sample_start": 1000, "global_index": 86_400_000}
    layout = sigmf_layout(write_meta(tmp_path / "air", 1000.0, first, second))
    assert layout.segments[1].lost_before == 86_399_000
