"""Files that are replaced as a whole."""

import os
import threading
from pathlib import Path

from uavrt.config.text_files import write_text_atomically


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "shared.toml").write_text("old")
    (tmp_path / "tags.toml").symlink_to("shared.toml")
    write_text_atomically(tmp_path / "tags.toml", "new")
    assert (tmp_path / "tags.toml").is_symlink()
    assert (tmp_path / "shared.toml").read_text() == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["shared.toml", "tags.toml"]


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write_text_atomically(pipe, "a tag")
    reader.join(10.0)
    assert read == ["a tag"]
    assert pipe.is_fifo()
