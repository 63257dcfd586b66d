"""A disk that keeps after a power cut what was synced, and nothing else.

It takes the calls of `os.fsync` in this process. Of a directory the names at its last sync are
kept, or with ``names="all"`` those of the moment (ext4 may write names before contents); of a
file the content at its last sync, else nothing: zero bytes.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

Names = Literal["synced", "all"]
_Entries = dict[str, tuple[int, bool]]


@dataclass(frozen=True, slots=True)
class Cut:
    """What the disk has at one moment."""

    synced: dict[int, _Entries]
    """Names, inodes and whether each is a directory, by the directory's inode."""
    now: dict[int, _Entries]
    contents: dict[int, bytes]

    def survives(self, root: Path, target: Path, names: Names) -> None:
        """Write what is left of a directory into a new one."""
        self._write(root.stat().st_ino, target, self.synced if names == "synced" else self.now)

    def _write(self, inode: int, target: Path, entries: dict[int, _Entries]) -> None:
        target.mkdir()
        for name, (child, is_directory) in entries.get(inode, {}).items():
            name = name.replace(f".{os.getpid()}.", ".1.")  # the next run is another process
            if is_directory:
                self._write(child, target / name, entries)
            else:
                (target / name).write_bytes(self.contents.get(child, b""))


def entries_below(root: Path) -> dict[int, _Entries]:
    """List a directory and those below it, by inode."""
    found: dict[int, _Entries] = {}
    for folder, _, _ in os.walk(root):
        with os.scandir(folder) as listed:
            found[os.stat(folder).st_ino] = {
                one.name: (one.inode(), one.is_dir()) for one in listed
            }
    return found


@contextmanager
def moments(root: Path) -> Iterator[list[Cut]]:
    """Record the disk before each sync of anything at or below a directory."""
    cuts: list[Cut] = []
    synced: dict[int, _Entries] = {}
    contents: dict[int, bytes] = {}
    held: list[int] = []
    real = os.fsync

    def fsync(descriptor: int) -> None:
        place = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        if place.is_relative_to(root):
            cuts.append(Cut(dict(synced), entries_below(root), dict(contents)))
            inode = os.fstat(descriptor).st_ino
            if place.is_dir():
                synced[inode] = entries_below(place)[inode]
            else:
                held.append(os.dup(descriptor))  # no other file gets its inode
                contents[inode] = place.read_bytes()
        real(descriptor)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", fsync)
        try:
            yield cuts
        finally:
            cuts.append(Cut(dict(synced), entries_below(root), dict(contents)))
            for descriptor in held:
                os.close(descriptor)
