"""Files that are replaced as a whole."""

import os
import threading
from contextlib import suppress
from pathlib import Path

import pytest

from uavrt.core.atomic_file import replacing, write_atomically


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "shared.toml").write_text("old")
    (tmp_path / "tags.toml").symlink_to("shared.toml")
    write_atomically(tmp_path / "tags.toml", "new")
    assert (tmp_path / "tags.toml").is_symlink()
    assert (tmp_path / "shared.toml").read_text() == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shared.toml", "tags.toml"]


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write_atomically(pipe, "a tag")
    reader.join(10.0)
    assert read == ["a tag"]
    assert pipe.is_fifo()


def test_file_and_name_are_on_the_disk_before_the_call_returns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[str] = []
    fsync = os.fsync

    def noted(descriptor: int) -> None:
        synced.append(Path(f"/proc/self/fd/{descriptor}").resolve().name)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    write_atomically(tmp_path / "tags.toml", b"new", sync=False)
    assert synced == []
    write_atomically(tmp_path / "tags.toml", b"newer")
    content, name = synced
    assert content.startswith(".tags.toml.")
    assert name == tmp_path.name


def test_what_fails_half_way_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "flight.npz").write_text("old")
    with suppress(ZeroDivisionError), replacing(tmp_path / "flight.npz") as part:
        part.write_bytes(b"half")
        raise ZeroDivisionError
    assert (tmp_path / "flight.npz").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["flight.npz"]
