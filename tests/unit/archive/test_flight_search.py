"""Flights by tag and day, and copies by month: the same answers, kept or not."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest
from archived_pulses import DAY_NS, archive, gathered, put

from uavrt.analysis.archive.parquet import flight_search
from uavrt.analysis.archive.parquet.flight_search import find_flights
from uavrt.analysis.archive.parquet.months import INDEX, read_index
from uavrt.analysis.archive.parquet.parquet_tables import PULSES, RECORDINGS
from uavrt.analysis.archive.parquet.questions import QUESTIONS, ask, kept_answer
from uavrt.core.errors import FormatError


@pytest.mark.parametrize("kept", [False, True])
def test_flights_are_found_by_tag_and_day_newest_first(tmp_path: Path, kept: bool) -> None:
    ledger = archive(tmp_path)
    put(tmp_path, ledger, 9, key="one", pulses=1)  # of tag 2 alone
    if kept:
        gathered(tmp_path, ledger)
    assert (kept_answer(tmp_path, "heard") is not None) == kept
    every = find_flights(tmp_path, limit=3)
    assert every.total == 10
    assert [one.flight for one in every.flights] == ["09", "08", "07"]
    newest, other, _ = every.flights
    assert (newest.start_time_ns, newest.end_time_ns) == (90 * DAY_NS, 90 * DAY_NS + 60 * 10**9)
    assert (newest.heard, other.heard) == (((2, 1),), ((2, 3), (4, 2)))
    last = find_flights(tmp_path, after=9, limit=3)
    assert ([one.flight for one in last.flights], last.total) == (["00"], 10)
    # Flight 04 has no pulse, 09 none of tag 4.
    of_tag = find_flights(tmp_path, tag_id=4)
    assert {one.flight for one in of_tag.flights} == {f"0{n}" for n in range(9) if n != 4}
    day = find_flights(tmp_path, tag_id=2, since_ns=30 * DAY_NS, before_ns=31 * DAY_NS)
    assert [one.flight for one in day.flights] == ["03"]
    assert find_flights(tmp_path, tag_id=6).total == 0


def test_what_is_newer_than_the_kept_answer_counts(tmp_path: Path) -> None:
    ledger = archive(tmp_path)
    gathered(tmp_path, ledger)
    put(tmp_path, ledger, 20, key="new", pulses=3)
    assert kept_answer(tmp_path, "heard") is None
    assert find_flights(tmp_path, tag_id=4).flights[0].heard == ((2, 2), (4, 1))
    gathered(tmp_path, ledger, least_files=100)
    assert len([*(tmp_path / "months").glob("heard-*")]) == 1
    assert find_flights(tmp_path, tag_id=4).flights[0].flight == "20"


def test_another_directory_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"contains no recordings\.parquet.*-o"):
        find_flights(tmp_path)


def test_rows_of_nothing_are_refused(tmp_path: Path) -> None:
    archive(tmp_path)
    place = tmp_path / RECORDINGS
    pq.write_table(pq.read_table(place).take([0] * 300_000), place, compression="zstd")
    for question in (lambda: find_flights(tmp_path), lambda: ask(tmp_path, QUESTIONS["list"])):
        with pytest.raises(FormatError, match="damaged: 300,000 rows without columns"):
            question()


def test_what_takes_too_much_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive(tmp_path)
    monkeypatch.setitem(flight_search._LIMITS, "memory_limit", "300kB")
    with pytest.raises(FormatError, match="more memory than 300kB"):
        find_flights(tmp_path)


def every(output: Path) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = ask(
        output, "select * from pulses order by start_time_ns, tag_id"
    ).to_pylist()
    return rows


def test_answers_are_the_same_with_months_and_without(tmp_path: Path) -> None:
    ledger = archive(tmp_path)
    before, tags = every(tmp_path), ask(tmp_path, QUESTIONS["tags"])
    assert gathered(tmp_path, ledger, 100) == 0  # too few files to be worth it
    assert gathered(tmp_path, ledger) == 3
    names = sorted(path.name[:7] for path in (tmp_path / "months" / PULSES).glob("*.parquet"))
    assert names == ["1970-01", "1970-02", "1970-03"]
    for path in (tmp_path / PULSES).glob("*"):
        path.write_bytes(b"")  # so that only the months can be read
    assert every(tmp_path) == before
    assert len(before) == 40
    assert ask(tmp_path, QUESTIONS["tags"]).equals(tags)


def test_what_is_newer_than_a_month_counts_and_is_taken_in_later(tmp_path: Path) -> None:
    ledger = archive(tmp_path)
    gathered(tmp_path, ledger)
    assert gathered(tmp_path, ledger) == 0
    put(tmp_path, ledger, 1, key="again", pulses=2)
    put(tmp_path, ledger, 20, key="new", pulses=3)
    now, tags = every(tmp_path), ask(tmp_path, QUESTIONS["tags"]).to_pylist()
    assert sum(one["pulses"] for one in tags) == len(now)
    assert len(now) == 40 - 5 + 2 + 3
    assert [one["flight"] for one in now if one["recording"] == "01"] == ["01", "01"]
    assert gathered(tmp_path, ledger) == 2  # January, July
    assert every(tmp_path) == now
    kept = {path.name for path in (tmp_path / "months" / PULSES).glob("*.parquet")}
    assert len(kept) == 4  # the old January has gone


def test_damaged_months_are_passed_over_and_made_again(tmp_path: Path) -> None:
    ledger = archive(tmp_path, flights=3)
    before = every(tmp_path)
    gathered(tmp_path, ledger)
    (month,) = (tmp_path / "months" / PULSES).glob("*.parquet")
    for path, content in ((month, b"rubbish"), (tmp_path / INDEX, b"{")):
        path.write_bytes(content)
        assert every(tmp_path) == before
        index, faults = read_index(tmp_path)
        assert [*faults] == [path.relative_to(tmp_path).as_posix()]
        assert not any(name.startswith(f"months/{PULSES}") for name in index)
        assert gathered(tmp_path, ledger) >= 1
