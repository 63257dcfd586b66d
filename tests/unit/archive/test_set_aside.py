"""What a batch cannot read is set aside, whatever was set aside before."""

from pathlib import Path

from uavrt.analysis.archive.parquet.ledger import ASIDE, Ledger
from uavrt.analysis.archive.parquet.parquet_tables import DONE, PULSES, RecordingRow

KEY = "0123456789abcdef"


def load(output: Path) -> dict[str, str]:
    return Ledger(output, DONE, RecordingRow, [PULSES]).damaged


def put(output: Path, name: str, content: bytes) -> str:
    (output / name).parent.mkdir(exist_ok=True)
    (output / name).write_bytes(content)
    return name


def test_a_kill_after_the_row_was_set_aside_does_not_lose_its_tables(tmp_path: Path) -> None:
    row = put(tmp_path, f"{DONE}/{KEY}.json", b"{}")
    assert row in load(tmp_path)
    # Its table is still there, as after a kill at this moment.
    table = put(tmp_path, f"{PULSES}/{KEY}.parquet", b"pulses")
    assert table in load(tmp_path)
    assert (tmp_path / ASIDE / table).read_bytes() == b"pulses"
    assert load(tmp_path) == {}


def test_a_table_of_no_row_is_removed_where_every_row_can_be_read(tmp_path: Path) -> None:
    table = put(tmp_path, f"{PULSES}/{KEY}.parquet", b"pulses")
    assert load(tmp_path) == {table: "no finished recording or flight refers to it"}
    assert not (tmp_path / table).exists()
    assert not (tmp_path / ASIDE).exists()


def test_what_is_set_aside_replaces_nothing_that_was_set_aside_before(tmp_path: Path) -> None:
    contents = [b"{}", b"[]", b"3"]
    for content in contents:
        row = put(tmp_path, f"{DONE}/{KEY}.json", content)
        assert row in load(tmp_path)
    kept = sorted((tmp_path / ASIDE / DONE).iterdir())
    assert sorted(one.read_bytes() for one in kept) == sorted(contents)
    assert all(one.suffix == ".json" for one in kept)
