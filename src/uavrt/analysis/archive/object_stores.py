"""Read recordings in object stores in pieces, without copying them.

A sparse local file has the size of the stored file but contains only its first and last bytes.
From it, the readers of SigMF, WAV and raw files determine where the samples are; the samples
are then read from the store.
"""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

from uavrt.core.errors import FormatError, StoreError, needs_extra
from uavrt.radio.files.recording_source import RecordingSource
from uavrt.radio.opening import open_recording

ENDS_BYTES = 1 << 20
"""Number of bytes copied from each end of a file, where WAV files have headers."""
BLOCK_BYTES = 8 << 20
"""Number of bytes read from a store at a time; at 17 MB/s a read takes half a second."""
MOST_BYTES = 1 << 50
MOST_META_BYTES = 64 << 20
MOST_DEPTH = 32
MOST_LINKS = 200_000
_MARKS = ("ETag", "etag", "mtime", "LastModified", "last_modified", "updated", "created")
_META, _DATA = ".sigmf-meta", ".sigmf-data"


def is_url(text: str) -> bool:
    """True for an address in an object store, in fsspec's form."""
    return "://" in text


def list_store(url: str) -> tuple[str, ...]:
    """List the files at and below an address. Raises `FormatError` if there are none,
    `StoreError` or `UsageError`.
    """
    with _store_errors(url):
        system, path = _opened(url)
        found = [path] if _is_file(system, path) else _below(system, path, url)
    if not found:
        raise FormatError(f"no file or folder exists at {url}", remedy="Check the address")
    return tuple(sorted(str(system.unstrip_protocol(one)) for one in found))


def _below(system: Any, path: str, url: str) -> list[str]:
    if "http" not in system.protocol:
        return list(system.find(path))
    # A web server may answer any path with a list, and so without end.
    found: list[str] = []
    seen, waiting = {path}, [(path, 0)]
    while waiting:
        folder, depth = waiting.pop()
        if depth > MOST_DEPTH or len(seen) > MOST_LINKS:
            raise StoreError(
                f"{url} contains too many or too deeply nested folders, for example "
                f"{folder[:200]}",
                remedy="Name one of its folders, or single recordings",
            )
        try:
            listed = system.ls(folder, detail=True)
        except FileNotFoundError:
            continue
        for one in listed:
            name = str(one["name"])
            if name in seen:
                continue
            seen.add(name)
            if one["type"] == "directory":
                waiting.append((name, depth + 1))
            else:
                found.append(name)
    return found or ([path] if system.isfile(path) else [])


def _size_of(system: Any, path: str, url: str) -> int:
    size = system.info(path).get("size")
    if not isinstance(size, int) or not 0 <= size <= MOST_BYTES:
        raise StoreError(
            f"{url}: the server reports no valid file size ({size})",
            remedy="Download the file, or use a server that sends Content-Length",
        )
    return size


def _is_file(system: Any, path: str) -> bool:
    """True if a path is a file. On a web server it must exist and have a file extension.

    A web server does not report whether a path is a folder, and listing a file would download
    it.
    """
    if "http" not in system.protocol:
        return bool(system.isfile(path))
    name = path.split("://", 1)[-1].partition("/")[2]
    return bool(PurePosixPath(name).suffix) and bool(system.exists(path))


def version_of(url: str) -> list[object]:
    """Properties of a stored file that change with its content; raises `StoreError`."""
    with _store_errors(url):
        system, path = _opened(url)
        about = system.info(path)
    return [url, about.get("size"), *(str(about[mark]) for mark in _MARKS if mark in about)]


def open_stored(url: str, **stated: Any) -> RecordingSource:
    """Open a recording at a URL; `stated` supplies metadata that the file lacks. Raises the
    errors of `open_recording`, and `StoreError`.
    """
    data_url = url[: -len(_META)] + _DATA if url.endswith(_META) else url
    with tempfile.TemporaryDirectory() as folder:
        copy = _ends(url, Path(folder), whole=url.endswith(_META))
        if data_url != url:
            _ends(data_url, Path(folder))
        with _named(url, str(copy)):
            source = open_recording(copy, **stated)
        source.close()
    return RecordingSource(source.layout, _StoredBytes(data_url))


class _StoredBytes:
    """A stored file as a random-access byte source for `RecordingSource`."""

    def __init__(self, url: str) -> None:
        self._url = url
        with _store_errors(url):
            system, path = _opened(url)
            self._size = _size_of(system, path, self._url)
            self._file = system.open(path, "rb", block_size=BLOCK_BYTES)

    def read_at(self, view: memoryview, offset: int) -> int:
        """Fill a buffer with bytes from an offset; return the number of bytes read. Raises
        `StoreError`.
        """
        with _store_errors(self._url):
            self._file.seek(offset)
            got = int(self._file.readinto(view))
        if got == 0:
            raise StoreError(
                f"{self._url} is truncated: it ends at byte {offset} of {self._size}",
                remedy="Repeat the command: it continues from there",
            )
        return got

    def close(self) -> None:
        self._file.close()


def _ends(url: str, folder: Path, *, whole: bool = False) -> Path:
    """Write a local copy of a stored file. Unless `whole`, the copy is sparse and has only the
    first and last bytes.
    """
    copy = folder / PurePosixPath(url).name
    with _store_errors(url):
        system, path = _opened(url)
        size = _size_of(system, path, url)
        if whole and size > MOST_META_BYTES:
            raise StoreError(
                f"{url} has {size / 1e6:.0f} MB, too large for a metadata file",
                remedy="Name the .sigmf-meta file, not the samples",
            )
        with copy.open("wb") as file:
            file.truncate(size)
            middle = size if whole else min(size, ENDS_BYTES)
            file.write(_piece(url, system, path, 0, middle))
            if (last := max(middle, size - ENDS_BYTES)) < size:
                file.seek(last)
                file.write(_piece(url, system, path, last, size))
    return copy


def _piece(url: str, system: Any, path: str, start: int, end: int) -> bytes:
    """Read bytes `start` to `end` of a stored file. Raises `StoreError` if the server cannot
    send parts of files.
    """
    piece = bytes(system.cat_file(path, start=start, end=end))
    if len(piece) > end - start:
        raise StoreError(
            f"{url}: the server cannot send parts of files",
            remedy="Download the file, or use a server with HTTP range requests",
        )
    return piece


@lru_cache(maxsize=64)
def _opened(url: str) -> tuple[Any, str]:
    with needs_extra("batch", "An object store"):
        from fsspec.core import url_to_fs
    try:
        system, path = url_to_fs(url)
    except ValueError as error:
        raise FormatError(f"{url}: {error}", remedy="Use s3://BUCKET/FOLDER") from error
    except ImportError as error:
        raise FormatError(
            f"{url}: {error}", remedy="Install the package that fsspec names for this store"
        ) from error
    return system, str(path)


@contextmanager
def _store_errors(url: str) -> Iterator[None]:
    """Context manager that converts errors of access to a store to `StoreError`."""
    try:
        yield
    except _faults() as error:
        raise StoreError(
            f"{url}: {str(error) or type(error).__name__}",
            remedy="Check the address and the network, then repeat the command: "
            "it continues where it stopped",
        ) from error


@contextmanager
def _named(url: str, copy: str) -> Iterator[None]:
    try:
        yield
    except FormatError as error:
        raise FormatError(error.message.replace(copy, url), remedy=error.remedy) from error


def _faults() -> tuple[type[Exception], ...]:
    """Types of exceptions that reading from a store may raise, as defined by the libraries
    loaded so far.
    """
    known: list[type[Exception]] = [OSError, EOFError]
    for module, names in (
        ("aiohttp", ("ClientError",)),
        ("botocore.exceptions", ("BotoCoreError", "ClientError")),
        ("gcsfs.retry", ("HttpError",)),
        ("azure.core.exceptions", ("AzureError",)),
    ):
        loaded = sys.modules.get(module)
        known += [getattr(loaded, name) for name in names if hasattr(loaded, name)]
    return tuple(known)
