"""What a program keeps over a restart is read, or put aside: it stops no start."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from uavrt.core.errors import FormatError
from uavrt.core.foreign import OWN, read_record
from uavrt.flight.kept_file import KeptFile

DEEP = b'{"a": ' + b"[" * 90_000 + b"]" * 90_000 + b"}"


def sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(OWN.bytes + 1)


@pytest.mark.parametrize(
    "make",
    [
        os.mkfifo,
        sparse,
        lambda path: path.write_bytes(DEEP),
        lambda path: path.write_bytes(b'{"a": "\xff"}'),
        lambda path: path.write_bytes(b'{"a": 1' + b"0" * 5000 + b"}"),
    ],
    ids=["pipe", "too large", "nested", "not UTF-8", "a huge number"],
)
def test_a_file_that_holds_no_record_is_put_aside(
    tmp_path: Path, make: Callable[[Path], object]
) -> None:
    path = tmp_path / "kept.json"
    make(path)
    with pytest.raises(FormatError):
        read_record(path, dict[str, list[int]])
    kept = KeptFile(path, dict[str, list[int]], "numbers")
    assert kept.read() is None
    assert not path.exists()
    assert path.with_suffix(".damaged").exists()
    kept.keep({"a": [1]})
    assert kept.read() == {"a": [1]}
