"""Read files and texts that come from users or other programs, with limits on their size.

Every parser of such a format uses these functions. They limit the bytes, the unpacked bytes,
the nesting and the number of values. A file beyond a limit is refused with an error of one
line. The limits are about ten times the usual sizes, and reading up to a limit takes at most 2
s and 200 MB. Only recordings, logs and terrain take time in proportion to their size.
"""

import json
import os
import re
import stat
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from xml.etree import ElementTree as ET

import msgspec

from uavrt.core.errors import FormatError

if TYPE_CHECKING:
    from zipfile import ZipFile

T = TypeVar("T")
CPU_S = 2
"""Maximum CPU time for reading one short file from another program [s]."""
MEMORY_BYTES = 200_000_000
"""Maximum memory for reading one file from another program [bytes]."""
MOST_FAULTS = 50
_REMEDY = "Check the name: another file may be meant"
_PIECE_BYTES = 1 << 20
_LARGE_BYTES = 50_000_000
_ZIP_END_BYTES, _ZIP_ENTRY_BYTES = 66_000, 100
_PIPES = ("/dev/fd/", "/dev/stdin", "/proc/self/fd/")
"""Prefixes of the paths of pipes that a shell creates, as in `uavrt tags check <(…)`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Limits of size and nesting for one kind of file."""

    what: str
    """Kind of file, for the error text: ``"a tag file"``."""
    bytes: int
    """Maximum size on the disk, and after unpacking [bytes]."""
    values: int = 100_000
    """Maximum number of elements, objects, lists and members in the file."""
    depth: int = 32

    def check_size(self, size: int, name: object) -> None:
        """Raise `FormatError` if a size exceeds the limit."""
        if size > self.bytes:
            raise FormatError(
                f"{name} is too large for {self.what}: more than {self.bytes:,} bytes",
                remedy=_REMEDY,
            )


SETTINGS = Limit(what="a settings file", bytes=200_000, values=5_000, depth=8)
TAGS = Limit(what="a tag file", bytes=1_000_000, values=100_000, depth=8)
YAML_TAGS = Limit(what="a list of tags in YAML", bytes=150_000, values=20_000, depth=8)
"""Limits for tag lists in YAML: PyYAML reads 200 kB a second, and 500 coded tags take 60 kB."""
SHAPES = Limit(what="an area or a path", bytes=2_000_000, values=100_000, depth=40)
NOTES = Limit(what="a description in JSON", bytes=20_000_000, values=500_000)
"""Limits for JSON files, such as SigMF metadata or results of a flight."""
ARCHIVE_NOTE = Limit(what="a note of an archive", bytes=200_000_000)
"""Limits for the JSON description of an archive of a million recordings."""
TEXT_LOG = Limit(what="a log", bytes=512 * 1024 * 1024, values=10_000_000)
"""Limits for text logs. Their lines are counted, because a small compressed file can contain a
huge number of line ends."""
OWN = Limit(what="a file of uavrt's own", bytes=20_000_000)
"""Limits for files in which uavrt stores its own data; a list of 10 000 flights takes 8 MB."""
KEYS = Limit(what="a key or certificate", bytes=200_000)
REQUEST = Limit(what="a request", bytes=500_000, values=60_000, depth=16)
"""Limits for requests to the ground station, which decodes them in at most 20 ms."""
UPLOADED_FILE = Limit(what="a file in a request", bytes=4_000_000, values=500_000, depth=16)
"""Limits for files uploaded to the web page; each comma in their text counts as a value."""
MAP_PART = Limit(what="a part of a map", bytes=1_500_000, values=50_000)
"""Limits for a directory or the description in a PMTiles map, both compressed and unpacked."""
ZIPPED_TILE = Limit(what="a packed tile of heights", bytes=30_000_000, values=1_000)
GPX = Limit(what="a track in GPX", bytes=100_000_000, values=2_000_000)
TRACK = Limit(what="an autopilot's log", bytes=2_000_000_000)


def read_file(path: str | os.PathLike[str], limit: Limit) -> bytes:
    """Read a whole file of another program or user; endless and too large files are refused."""
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | getattr(os, "O_NONBLOCK", 0))
    with os.fdopen(handle, "rb") as file:
        about = os.fstat(handle)
        if stat.S_ISDIR(about.st_mode):
            raise IsADirectoryError(21, "is a directory", os.fspath(path))
        if not stat.S_ISREG(about.st_mode):
            require_plain_file(path, about.st_mode)
            os.set_blocking(handle, True)
        limit.check_size(about.st_size, os.fspath(path))
        _check_holes(about, os.fspath(path))
        # A pipe has no size, and a log may grow; each read allocates all that it may return.
        pieces = [file.read(about.st_size + 1)]
        while pieces[-1] and sum(map(len, pieces)) <= limit.bytes:
            pieces.append(file.read(_PIECE_BYTES))
        content = b"".join(pieces) if any(pieces[1:]) else pieces[0]
    limit.check_size(len(content), os.fspath(path))
    return content


def _check_holes(about: os.stat_result, name: object) -> None:
    """Raise `FormatError` for a large file that is mostly sparse (has few disk blocks)."""
    written = 512 * getattr(about, "st_blocks", about.st_size)
    if about.st_size > _LARGE_BYTES and written < about.st_size // 8:
        raise FormatError(
            f"{name} is incomplete: {written:,} of {about.st_size:,} bytes are on the disk",
            remedy="Copy it again",
        )


def require_plain_file(path: str | os.PathLike[str], mode: int | None = None) -> None:
    """Raise `FormatError` for a socket, device or pipe, unless it is a pipe from a shell.

    `mode`: file mode from `os.stat` (st_mode).
    """
    name = os.fspath(path)
    mode = os.stat(path).st_mode if mode is None else mode
    passed = stat.S_ISFIFO(mode) and name.startswith(_PIPES)
    if not (stat.S_ISREG(mode) or passed):
        raise FormatError(f"{name} is not a plain file", remedy=_REMEDY)


def open_zip(path: Path, limit: Limit) -> "ZipFile":
    """Open a zip file; its members must be stored or deflated."""
    from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

    size = size_of(path)
    limit.check_size(size, path)
    with path.open("rb") as file:
        file.seek(max(0, size - _ZIP_END_BYTES))
        end = file.read()
    # zipfile reads the whole directory; its size is 12 bytes after these marks.
    directories = [
        int.from_bytes(end[found.start() + 12 : found.start() + 16], "little")
        for found in re.finditer(rb"PK\x05\x06", end)
    ]
    most = _ZIP_ENTRY_BYTES * limit.values
    if not directories or max(directories) > most or b"PK\x06\x07" in end:
        raise ValueError("the file is not a zip file, is truncated, or has too many entries")
    archive = ZipFile(path)
    if any(one.compress_type not in (ZIP_STORED, ZIP_DEFLATED) for one in archive.infolist()):
        archive.close()
        raise ValueError("the zip file is compressed, but not with deflate")
    return archive


_GZIP_BITS = 31
"""zlib's window parameter for gzip with the largest window."""


def unpack(pieces: Iterable[bytes], most: int) -> bytes:
    """Unpack gzip data; reading stops at `most` bytes, so that a zip bomb does no harm."""
    content = bytearray()
    unpacker = zlib.decompressobj(_GZIP_BITS)
    for piece in pieces:
        while piece and len(content) <= most:
            if unpacker.eof:  # several members, as `cat a.gz b.gz` makes
                piece = piece.lstrip(b"\0")
                if not piece:
                    break
                unpacker = zlib.decompressobj(_GZIP_BITS)
            content += unpacker.decompress(piece, most + 1 - len(content))
            piece = unpacker.unused_data if unpacker.eof else unpacker.unconsumed_tail
        if len(content) > most:
            return bytes(content)
    if not unpacker.eof:
        raise EOFError("the gzip data are truncated")
    return bytes(content)


def pieces_of(content: bytes) -> Iterable[bytes]:
    """Split bytes into pieces, because unpacking them piece by piece copies less data."""
    view = memoryview(content)
    for start in range(0, len(content), _PIECE_BYTES):
        yield bytes(view[start : start + _PIECE_BYTES])


def read_json(content: bytes | str, limit: Limit) -> Any:
    """Decode JSON from another program; raises `ValueError` if invalid or beyond a limit."""
    if len(content) > limit.bytes:
        raise ValueError(f"the content is too long: more than {limit.bytes:,} bytes")
    # Commas in texts count, too: they are few compared with the limit.
    if isinstance(content, str):
        marks = sum(content.count(mark) for mark in (",", "[", "{"))
    else:
        marks = sum(content.count(mark) for mark in (b",", b"[", b"{"))
    if marks > 2 * limit.values:
        raise ValueError(f"the content has more than {limit.values:,} values")
    try:
        found = json.loads(content)
    except json.JSONDecodeError as error:
        raise ValueError(f"the JSON is invalid from line {error.lineno} on") from None
    except RecursionError:
        raise ValueError("the content is nested too deeply") from None
    level = [found] if isinstance(found, list | dict) else []
    for _ in range(limit.depth):
        if not level:
            return found
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, list | dict)
        ]
    raise ValueError(f"the content is nested more than {limit.depth} levels deep")


def read_record(path: str | os.PathLike[str], kind: type[T], limit: Limit = OWN) -> T:
    """Read a JSON file of one record; raises `OSError`, or `FormatError` if damaged."""
    return decode_record(read_file(path, limit), kind)


def decode_record(content: bytes | str | msgspec.Raw, kind: type[T]) -> T:
    """Decode a record of class `kind` from JSON; raises `FormatError` with the reason."""
    try:
        return msgspec.json.decode(content, type=kind)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise FormatError(str(error)) from None


def read_xml(text: str, limit: Limit, root: str) -> ET.Element:
    """Parse XML from another program from the element `root` on; entities are refused.

    The XML declaration is skipped, because the text is already decoded.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError("the content declares XML entities, which are not allowed")
    if len(text) > limit.bytes:
        raise ValueError(f"the content is too long: more than {limit.bytes:,} characters")
    if text.count("<") + text.count("=") > 2 * limit.values:
        raise ValueError(f"the content has more than {limit.values:,} elements")
    found = ET.fromstring(text[text.find(f"<{root}") :] if f"<{root}" in text else text)
    level = [found]
    for _ in range(limit.depth):
        level = [inner for outer in level for inner in outer]
        if not level:
            return found
    raise ValueError(f"the content is nested more than {limit.depth} levels deep")


_TOML_QUIET = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*(?:"""|\Z)' + r"|'''(?:[^']|'(?!''))*(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\[^\n])*(?:"|(?=\n)|\Z)' + r"|'[^'\n]*(?:'|(?=\n)|\Z)|#[^\n]*",
    re.S,
)
"""Pattern of strings and comments in TOML, whose brackets and dots are not syntax."""
_TOML_MARK = re.compile(r"[\[\]{}=]|[\w-]+(?:[ \t]*\.[ \t]*[\w-]+)*")


def check_toml(text: str, limit: Limit) -> None:
    """Raise `ValueError` for TOML text that `tomllib` would take minutes to parse.

    The parser's time grows with the square of the number of parts in a dotted key. Its stack
    grows with each level of brackets.
    """
    if len(text) > limit.bytes:
        raise ValueError(
            f"the text has {len(text):,} characters; {limit.what} can have at most "
            f"{limit.bytes:,}"
        )
    bare = _TOML_QUIET.sub(lambda found: "" if found[0][0] == "#" else "x", text)
    values = depth = 0
    for found in _TOML_MARK.finditer(bare):
        mark = found[0]
        if mark == "=":
            values += 1
        elif mark in "[{":
            depth, values = depth + 1, values + 1
        elif mark in "]}":
            depth -= 1
        elif mark.count(".") >= limit.depth:
            raise ValueError(f"a dotted name has more than {limit.depth} parts")
        if depth > limit.depth:
            raise ValueError(f"the content is nested more than {limit.depth} levels deep")
    if values > limit.values:
        raise ValueError(f"the content has more than {limit.values:,} values")


def shortened(faults: list[str]) -> list[str]:
    """Return the first faults of a list and a line with the number of further faults."""
    if len(faults) <= MOST_FAULTS:
        return faults
    return [*faults[:MOST_FAULTS], f"and {len(faults) - MOST_FAULTS} more"]


def size_of(path: Path) -> int:
    """Size of a plain file [bytes]; raises `OSError`, or `FormatError` for a device."""
    about = path.stat()
    require_plain_file(path, about.st_mode)
    _check_holes(about, path)
    return about.st_size


def most_unpacked(packed: int) -> int:
    """Maximum unpacked size of a text file [bytes].

    Logs compress to about a tenth of their size, but zip bombs to far less.
    """
    return max(4_000_000, 40 * packed)
