"""Find the line number of each value in a TOML file, which ``tomllib`` does not report."""

import re

Path = tuple[str | int, ...]

_TABLE = re.compile(r"\s*(\[\[?)([^\[\]]+)\]")
_KEY = re.compile(
    r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*="""
)
_TRIPLE = re.compile(r"\"\"\"|'''")


def find_lines(text: str) -> dict[Path, int]:
    r"""Find the line of each table and key of a TOML text that ``tomllib`` accepts.

    Keys inside inline tables and arrays have the line of the key they belong to (see
    `line_of`).

    >>> find_lines('[[tag]]\nid = 2\n[[tag]]\nid = 4\n')[("tag", 1, "id")]
    4
    """
    lines: dict[Path, int] = {}
    counts: dict[Path, int] = {}
    table: Path = ()
    inside: str | None = None
    for number, line in enumerate(text.split("\n"), start=1):
        if inside is None:
            if header := _TABLE.match(line):
                table = _split(header.group(2))
                if header.group(1) == "[[":
                    index = counts.get(table, 0)
                    counts[table] = index + 1
                    table = (*table, index)
                for length in range(1, len(table) + 1):
                    lines.setdefault(table[:length], number)
            elif key := _KEY.match(line):
                lines.setdefault((*table, *_split(key.group(1))), number)
        for quotes in _TRIPLE.findall(line):
            inside = quotes if inside is None else None if quotes == inside else inside
    return lines


def line_of(lines: dict[Path, int], path: Path) -> int | None:
    """Return the line number of a value, or of the nearest enclosing key or table; None if
    there is neither.
    """
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return None


def _split(key: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in key.split("."))
