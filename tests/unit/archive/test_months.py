"""Copies by month give the same answers as the files they are made of."""

from pathlib import Path

from archived_pulses import archive, gathered, put

from uavrt.analysis.archive.parquet.months import INDEX, read_index
from uavrt.analysis.archive.parquet.parquet_tables import PULSES
from uavrt.analysis.archive.parquet.questions import QUESTIONS, ask


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
