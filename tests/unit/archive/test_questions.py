from pathlib import Path

import made
import pyarrow as pa
import pytest
from archived_pulses import DAY_NS, recording_row
from command_line import Ran

from uavrt.analysis.archive.parquet.parquet_tables import (
    RECORDINGS,
    RecordingRow,
    write_pulses,
    write_rows,
)
from uavrt.analysis.archive.parquet.questions import QUESTIONS, ask
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import Pulse


def pulse(tag_id: int, day: int, snr_db: float, *, confirmed: bool) -> Pulse:
    start_ns = day * DAY_NS + 788  # a real clock's; Python's times have no nanoseconds
    return made.pulse(
        start_ns,
        tag_id=tag_id,
        frequency_hz=148.7e6,
        snr_db=snr_db,
        noise_psd=1e-9,
        confirmed=confirmed,
        also_possible_tag_ids=(4, 6),
    )


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    for number, day in (("07", 1), ("o'hare", 3)):
        found = [
            pulse(2, day, 10.0, confirmed=True),
            pulse(2, day + 1, 14.0, confirmed=True),
            pulse(4, day, 3.0, confirmed=False),
        ]
        path = tmp_path / "pulses" / f"{number}.parquet"
        write_pulses(path, [(0, one) for one in found], "/archive/x.wav", number)
    rows = [recording_row(flight, 3) for flight in ("07", "o'hare")]
    write_rows(tmp_path / RECORDINGS, RecordingRow, rows)
    return tmp_path


def test_tags_are_counted_over_all_flights(archive: Path) -> None:
    answer = ask(archive, QUESTIONS["tags"])
    for name in ("first_utc", "last_utc"):
        times = answer[name].cast(pa.timestamp("us", "UTC"), safe=False)
        answer = answer.set_column(answer.column_names.index(name), name, times)
    two, four = answer.to_pylist()
    assert (two["tag_id"], two["pulses"], two["confirmed"], two["flights"]) == (2, 4, 4, 2)
    assert two["median_snr_db"] == 12.0
    assert (str(two["first_utc"])[:10], str(two["last_utc"])[:10]) == (
        "1970-01-02",
        "1970-01-05",
    )
    assert (four["confirmed"], four["median_snr_db"]) == (0, None)


def test_the_name_of_a_flight_stays_a_word_and_whole(archive: Path) -> None:
    assert ask(archive, QUESTIONS["list"])["flight"].to_pylist() == ["07", "o'hare"]
    flights = ask(archive, "select distinct flight from pulses order by 1")
    assert flights["flight"].to_pylist() == ["07", "o'hare"]


def test_an_archive_without_a_pulse_answers_with_nothing(tmp_path: Path) -> None:
    write_rows(tmp_path / RECORDINGS, RecordingRow, [recording_row("07", 0)])
    assert ask(tmp_path, QUESTIONS["tags"]).num_rows == 0


def test_a_wrong_question_or_place_is_named(archive: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nosuch"):
        ask(archive, "select nosuch from pulses")
    with pytest.raises(FormatError, match=r"contains no recordings\.parquet"):
        ask(archive / "pulses", QUESTIONS["tags"])
    (archive / "pulses" / "07.parquet").write_bytes(b"rubbish")
    with pytest.raises(FormatError, match="--verify"):
        ask(archive, QUESTIONS["tags"])


def test_the_command_line_answers_as_table_as_json_and_as_file(archive: Path, ran: Ran) -> None:
    assert "median_snr_db" in ran("archive", "tags", archive).out
    assert '"flight": "07"' in ran("archive", "list", archive, "--json").out
    answer = archive / "answer.csv"
    question = "select tag_id, count(*) as n from pulses group by 1 order by 1"
    query = ("archive", "query", archive, question, "-o", answer)
    ran(*query)
    assert answer.read_text().split() == ['"tag_id","n"', "2,4", "4,2"]
    assert "--overwrite" in ran(*query, ends=2).err


def test_answers_show_places_to_a_metre_and_small_numbers(archive: Path, ran: Ran) -> None:
    asked = "select 35.180113::double as latitude_deg, 1.5e-9 as noise_psd, 22.61::double as m"
    shown = ran("archive", "query", archive, asked).out.split()
    assert shown[-3:] == ["35.180113", "1.5e-09", "22.6"]


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ("select also_possible_tag_ids from pulses", '"[4, 6]"'),
        (
            "select '=1+1' as name, '-3.5' as number, null::varchar as missing",
            '"\'=1+1","-3.5",',
        ),
    ],
    ids=["list", "formula"],
)
def test_lists_and_what_begins_as_a_formula_are_text_in_a_csv_file(
    archive: Path, tmp_path: Path, ran: Ran, asked: str, line: str
) -> None:
    table = tmp_path / "answer.csv"
    ran("archive", "query", archive, asked, "-o", table)
    assert table.read_text().splitlines()[1] == line
