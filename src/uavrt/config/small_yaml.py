"""As much of YAML as lists of tags need: what people type and what programs dump.

Lists and mappings, indented or in brackets (over several lines, too), plain and quoted text,
comments. Anchors, types and folded text are faults. Every node knows its line, and reading goes
on after a fault, so that all are told at once.
"""

import json
import re
from dataclasses import dataclass

from uavrt.config.tag_drafts import Fault

_DEEPEST = 20
_KEY = re.compile(r"""("(?:[^"\\]|\\.)*"|'(?:[^']|'')*'|[^\s\[\]{},"'#:][^:]*?)\s*:(?:\s+|$)""")
_TIGHT_KEY = re.compile(r"(\w+):(?=\S)")
"""Not YAML, but what is meant is clear: ``id:12``."""
_NOT_READ = tuple("&*!|>%@`")
_PLAIN_END = re.compile(r"[,\[\]{}]|:(?=\s|$)")
_QUOTED = re.compile(r"""(?:"(?:[^"\\]|\\.)*"|'(?:[^']|'')*')(?=\s*(?:[,\]}:#]|$))""")
_NULLS = ("", "~", "null", "Null", "NULL")


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A value and its line; null is None."""

    line: int
    value: "str | list[Node] | dict[str, Node] | None"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    number: int
    indent: int
    text: str

    @property
    def is_item(self) -> bool:
        return self.text == "-" or self.text.startswith("- ")


def parse_small_yaml(text: str, faults: list[Fault]) -> list[Node]:
    """Read the blocks of a text, mostly one; add what is not understood to `faults`."""
    return _Blocks(text, faults).all()


class _Blocks:
    def __init__(self, text: str, faults: list[Fault]) -> None:
        self._faults = faults
        self._lines: list[_Line] = []
        self._place = 0
        for number, written in enumerate(text.split("\n"), start=1):
            line = _without_comment(written).rstrip()
            content = line.lstrip()
            if content in ("", "---", "..."):
                continue
            if "\t" in line[: len(line) - len(content)]:
                self._fault(number, "YAML is indented with spaces, not tabs")
            indent = len(line) - len(content)
            self._lines.append(_Line(number=number, indent=indent, text=content))

    def all(self) -> list[Node]:
        found = []
        while self._next() is not None:
            found.append(self._block(0))
        return found

    def _fault(self, line: int, text: str) -> None:
        self._faults.append(Fault(line=line, text=text))

    def _next(self) -> _Line | None:
        return self._lines[self._place] if self._place < len(self._lines) else None

    def _block(self, depth: int) -> Node:
        """Read what begins at the next line, which there is."""
        line = self._lines[self._place]
        if depth > _DEEPEST:
            self._place += 1
            self._fault(line.number, "nested too deeply for a list of tags")
            return Node(line=line.number, value=None)
        if line.is_item:
            return self._sequence(line, depth)
        if _key(line.text) is not None:
            return self._mapping(line, depth)
        self._place += 1
        return self._value(line.text, line)

    def _sequence(self, first: _Line, depth: int) -> Node:
        items: list[Node] = []
        while (line := self._next()) is not None and line.indent >= first.indent:
            if line.indent > first.indent or not line.is_item:
                if line.indent == first.indent and _key(line.text) is not None:
                    break  # a list that stands no deeper than its key has ended
                self._place += 1
                self._misplaced(line)
                continue
            content = line.text[1:].lstrip()
            if content:
                indent = line.indent + len(line.text) - len(content)
                rest = _Line(number=line.number, indent=indent, text=content)
                self._lines[self._place] = rest
                items.append(self._block(depth + 1))
            else:
                self._place += 1
                items.append(self._inside(line, depth))
        return Node(line=first.number, value=items)

    def _mapping(self, first: _Line, depth: int) -> Node:
        pairs: dict[str, Node] = {}
        while (line := self._next()) is not None and line.indent >= first.indent:
            found = _key(line.text) if line.indent == first.indent else None
            if found is None or line.is_item:
                if line.is_item and line.indent == first.indent:
                    break
                self._place += 1
                self._misplaced(line)
                continue
            key, content = found
            self._place += 1
            value = self._value(content, line) if content else self._inside(line, depth, key)
            if key in pairs:
                self._fault(line.number, f"{key[:40]} is given twice")
            pairs[key] = value
        return Node(line=first.number, value=pairs)

    def _inside(self, above: _Line, depth: int, key: str | None = None) -> Node:
        """Read what stands under a key or a dash; null, if nothing does."""
        line = self._next()
        if line is not None and (
            line.indent > above.indent
            or (key is not None and line.is_item and line.indent == above.indent)
        ):
            return self._block(depth + 1)
        return Node(line=above.number, value=None)

    def _misplaced(self, line: _Line) -> None:
        text = f"{line.text[:40]!r} does not fit the lines above: write key: value under them"
        self._fault(line.number, text)

    def _value(self, text: str, line: _Line) -> Node:
        """Read a value that begins on a line, whose key or dash may be left of it."""
        if text[0] in "[{":
            return _Brackets(self, text, line).read()
        if text.startswith(_NOT_READ):
            self._fault(line.number, f"{text[:40]!r} is not read here: write the value itself")
            return Node(line=line.number, value=None)
        return Node(line=line.number, value=_scalar(text))

    def more(self, line: _Line) -> _Line | None:
        """Take the next line into brackets that `line` opened, if it may belong there."""
        following = self._next()
        if following is None:
            return None
        if following.indent <= line.indent and following.text[0] not in "]}":
            return None
        self._place += 1
        return following

    def fault(self, line: int, text: str) -> None:
        """Tell a fault inside brackets."""
        self._fault(line, text)


class _Brackets:
    """What stands in brackets: ``[22.0, 48.8]`` or ``{id: 13}``."""

    def __init__(self, blocks: _Blocks, text: str, line: _Line) -> None:
        self._blocks, self._first = blocks, line
        self._rest, self._number = text, line.number
        self._open = True

    def read(self) -> Node:
        node = self._node(0)
        if self._open and self._rest.strip():
            text = f"{self._rest.strip()[:40]!r} after the bracket is not understood"
            self._blocks.fault(self._number, text)
        return node

    def _peek(self) -> str:
        """Next character that is no space, over the lines' ends; empty where they end."""
        while self._open:
            self._rest = self._rest.lstrip()
            if self._rest:
                return self._rest[0]
            line = self._blocks.more(self._first)
            if line is None:
                self._open = False
                self._blocks.fault(self._first.number, "a bracket is opened and not closed")
            else:
                self._rest, self._number = line.text, line.number
        return ""

    def _node(self, depth: int) -> Node:
        first = self._peek()
        number = self._number
        if depth > _DEEPEST:
            self._open = False
            self._blocks.fault(number, "nested too deeply for a list of tags")
            return Node(line=number, value=None)
        if first == "[":
            return Node(line=number, value=self._items(depth))
        if first == "{":
            return Node(line=number, value=self._pairs(depth))
        if first in _NOT_READ:
            self._blocks.fault(number, f"{first!r} is not read here: write the value itself")
        return Node(line=number, value=_scalar(self._text()))

    def _items(self, depth: int) -> list[Node]:
        items: list[Node] = []
        self._rest = self._rest[1:]
        while (mark := self._peek()) and mark != "]":
            if mark in ",}:":
                self._rest = self._rest[1:]
                if mark != ",":
                    self._blocks.fault(self._number, f"{mark!r} among the values of a list")
                continue
            items.append(self._node(depth + 1))
        self._rest = self._rest[1:]
        return items

    def _pairs(self, depth: int) -> dict[str, Node]:
        pairs: dict[str, Node] = {}
        self._rest = self._rest[1:]
        while (mark := self._peek()) and mark != "}":
            number = self._number
            if mark == ",":
                self._rest = self._rest[1:]
                continue
            text = self._text()
            if not text:
                self._blocks.fault(number, f"{mark!r} among the keys of a mapping")
                self._rest = self._rest[1:]
                continue
            key, value = _scalar(text) or "", Node(line=number, value=None)
            if self._peek() == ":":
                self._rest = self._rest[1:]
                if self._peek() not in ("", ",", "}"):
                    value = self._node(depth + 1)
            elif (tight := _TIGHT_KEY.match(text)) is not None:
                key, value = tight[1], Node(line=number, value=_scalar(text[tight.end() :]))
            else:
                self._blocks.fault(number, f"{text[:40]!r} has no value: write key: value")
            if key in pairs:
                self._blocks.fault(number, f"{key[:40]} is given twice")
            pairs[key] = value
        self._rest = self._rest[1:]
        return pairs

    def _text(self) -> str:
        """Take a plain or quoted text off the rest of the line."""
        quoted = _QUOTED.match(self._rest)
        if quoted is not None:
            end = quoted.end()
        else:
            mark = _PLAIN_END.search(self._rest)
            end = len(self._rest) if mark is None else mark.start()
        text, self._rest = self._rest[:end], self._rest[end:]
        return text.strip()


def _key(text: str) -> tuple[str, str] | None:
    """Part a line into its key and what comes after; None where there is no key."""
    found = _KEY.match(text) or _TIGHT_KEY.match(text)
    if found is None:
        return None
    return _scalar(found[1]) or "", text[found.end() :]


def _scalar(text: str) -> str | None:
    if len(text) >= 2 and text[0] == text[-1] == '"':
        try:
            return str(json.loads(text))
        except ValueError:
            return text[1:-1]
    if len(text) >= 2 and text[0] == text[-1] == "'":
        return text[1:-1].replace("''", "'")
    return None if text in _NULLS else text


def _without_comment(line: str) -> str:
    """Cut a line at the # of a comment, not at one within quotes or a word."""
    place, before = 0, ""
    while place < len(line):
        mark = line[place]
        if mark in "\"'" and before.rstrip()[-1:] in ("", ":", ",", "[", "{", "-"):
            quoted = _QUOTED.match(line, place)
            if quoted is not None:
                place, before = quoted.end(), "x"
                continue
        elif mark == "#" and before[-1:] in ("", " ", "\t"):
            return line[:place]
        before = before + mark if mark in " \t" else mark
        place += 1
    return line
