"""Read text as editors save it: UTF-8 or UTF-16, with or without a byte order mark."""

import codecs
from pathlib import Path

from uavrt.core.errors import FormatError
from uavrt.core.foreign import TAGS, Limit, read_file

MAX_BYTES = TAGS.bytes
"""Largest tag file accepted [bytes]; 5 000 tags take 0.3 MB."""

_UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def decode_text(content: bytes) -> str:
    """Decode a file's bytes as text in which all line ends are newlines.

    Raises `ValueError`, with the reason, for a file that is too large or not text.
    """
    if len(content) > MAX_BYTES:
        raise ValueError(f"the file has {len(content)} bytes; at most {MAX_BYTES} are allowed")
    encoding = "utf-16" if content.startswith(_UTF16_MARKS) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line}: not text (save the file as UTF-8)") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_text(path: Path, limit: Limit) -> str:
    """Read a text file; raises `FormatError` with the reason."""
    try:
        content = read_file(path, limit)
    except FileNotFoundError:
        raise FormatError(
            f"{path} does not exist", remedy="Check the name of the file"
        ) from None
    except OSError as error:
        raise FormatError(
            f"{path} cannot be read: {error.strerror}", remedy="Check the name of the file"
        ) from error
    encoding = "utf-16" if content.startswith(_UTF16_MARKS) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        raise FormatError(
            f"{path} is not text",
            remedy="Choose another file, or save this one in the encoding UTF-8",
        ) from None
    if not text.strip():
        raise FormatError(
            f"{path} is empty", remedy="Check the file's name, and whether the copy is complete"
        )
    return text
