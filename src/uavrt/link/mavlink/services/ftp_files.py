"""Directory tree that MAVLink FTP clients can read: one directory and files made in memory.

File names with ``..`` and symbolic links are refused, so that clients cannot read outside the
directory. Only regular files and directories are visible.
"""

import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from uavrt.link.mavlink.services.ftp_wire import FtpError

CRC_PART = 1 << 20


class FileRefused(Exception):
    """Raised for a request that cannot be served; internal to the file server."""

    def __init__(self, error: FtpError, number: int = 0) -> None:
        self.error = error
        self.number = number
        super().__init__(error.name)


class FileTree:
    """Directory `root` as file clients see it, with `extra` files that exist only in memory."""

    def __init__(self, root: str | Path, extra: Mapping[str, bytes] | None = None) -> None:
        self.root = Path(root)
        self.extra: dict[str, bytes] = dict(extra or {})

    def entries(self, name: str) -> list[bytes]:
        """List a directory as MAVLink FTP does; raises `FileRefused`.

        An entry is ``F``, name, tab and size for a file, or ``D`` and name for a directory.
        """
        parts = _parts(name)
        inside = "/".join(parts)
        found = self._extra_entries(inside)
        try:
            place = self._inside(parts)
            with os.scandir(place) as scan:
                for entry in scan:
                    line = _entry_line(entry)
                    if line is not None:
                        found[entry.name] = line
        except FileRefused:
            if not found and inside:
                raise
        except OSError as error:
            if not found and inside:
                raise _refusal(error) from error
        return [found[key] for key in sorted(found)]

    def open(self, name: str) -> tuple[BinaryIO | bytes, int]:
        """Open a file; return it and its size. Raises `FileRefused`."""
        parts = _parts(name)
        content = self.extra.get("/".join(parts))
        if content is not None:
            return content, len(content)
        try:
            place = self._inside(parts)
            handle = os.open(place, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            status = os.fstat(handle)
            if not stat.S_ISREG(status.st_mode):
                os.close(handle)
                raise FileRefused(FtpError.FILE_NOT_FOUND)
            return os.fdopen(handle, "rb", buffering=0), status.st_size
        except OSError as error:
            raise _refusal(error) from error

    def _inside(self, parts: list[str]) -> Path:
        """Path of a client's file name; `FileRefused` if it is outside the directory."""
        root = Path(os.path.realpath(self.root))
        place = root.joinpath(*parts)
        if os.path.realpath(place) != str(place):
            raise FileRefused(FtpError.FILE_NOT_FOUND)
        return place

    def _extra_entries(self, directory: str) -> dict[str, bytes]:
        found: dict[str, bytes] = {}
        start = f"{directory}/" if directory else ""
        for path, content in self.extra.items():
            if path.startswith(start):
                name, deeper, _ = path[len(start) :].partition("/")
                encoded = name.encode()
                line = b"D" + encoded if deeper else b"F%s\t%d" % (encoded, len(content))
                found[name] = line
        return found


def read_at(file: BinaryIO | bytes, offset: int, size: int) -> bytes:
    """Read bytes of an open file from an offset; empty at the end. Raises `FileRefused`."""
    if isinstance(file, bytes):
        return file[offset : offset + size]
    try:
        return os.pread(file.fileno(), size, offset)
    except OSError as error:
        raise _refusal(error) from error


def close(file: BinaryIO | bytes) -> None:
    """Close a file that `FileTree.open` returned."""
    if not isinstance(file, bytes):
        file.close()


def _parts(name: str) -> list[str]:
    """Split a client's file name at slashes; prefixes like ``@MAV_LOG`` are plain names."""
    parts = [part for part in name.split("/") if part not in ("", ".")]
    if ".." in parts or "\0" in name:
        raise FileRefused(FtpError.FILE_NOT_FOUND)
    return parts


def _entry_line(entry: "os.DirEntry[str]") -> bytes | None:
    """Line of a directory entry; None for links, devices and names that cannot be sent."""
    try:
        name = entry.name.encode()
        if b"\t" in name or len(name) > 200:
            return None
        if entry.is_dir(follow_symlinks=False):
            return b"D" + name
        if entry.is_file(follow_symlinks=False):
            return b"F%s\t%d" % (name, entry.stat(follow_symlinks=False).st_size)
    except (OSError, UnicodeEncodeError):
        return None
    return None


def _refusal(error: OSError) -> FileRefused:
    if isinstance(error, FileNotFoundError | NotADirectoryError | IsADirectoryError):
        return FileRefused(FtpError.FILE_NOT_FOUND)
    if isinstance(error, PermissionError):
        return FileRefused(FtpError.FILE_PROTECTED)
    return FileRefused(FtpError.FAIL_ERRNO, (error.errno or 0) & 0xFF)
