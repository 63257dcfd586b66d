"""Texts in the sources of the page, and the catalogue's words for them."""

import json
import re
from collections.abc import Generator, Iterator
from pathlib import Path

PAGE = Path(__file__).parents[2] / "page/src"
CATALOGUE: dict[str, str] = json.loads((PAGE / "texts.json").read_text(encoding="utf-8"))


EXPRESSION = re.compile(r"/(?![*/ ])(?:\\.|\[[^\]\n]*\]|[^/\n\\])+/[a-z]*(?=[.,;) ])")
"""A regular expression of JavaScript."""


def literals(source: str) -> Iterator[str]:
    """Every string of a TypeScript source; what a template puts in is ``{}``."""
    place = 0
    while place < len(source):
        if source.startswith("//", place):
            place = source.find("\n", place)
            place = len(source) if place < 0 else place
        elif source.startswith("/*", place):
            place = source.index("*/", place) + 2
        elif source[place] == '"':
            end = place + 1
            while source[end] != '"':
                end += 2 if source[end] == "\\" else 1
            yield json.loads(source[place : end + 1])
            place = end + 1
        elif source[place] == "`":
            place = yield from _template(source, place + 1)
        elif source[place] == "/" and (
            found := re.compile(
                r"/(?![*/ ])(?:\\.|\[[^\]\n]*\]|[^/\n\\])+/[a-z]*(?=[.,;) ])"
            ).match(source, place)
        ):
            place = found.end()
        else:
            place += 1


def _template(source: str, place: int) -> Generator[str, None, int]:
    text = ""
    while source[place] != "`":
        if source.startswith("${", place):
            depth, begin = 1, place + 2
            place = begin
            while depth:
                if source[place] == "`":
                    place = yield from _template(source, place + 1)
                    continue
                depth += {"{": 1, "}": -1}.get(source[place], 0)
                place += 1
            code = re.sub(r"`[^`]*`", "", source[begin : place - 1])
            yield from re.findall(r'"([^"\n]*)"', code)
            text += "{}"
        else:
            step = 2 if source[place] == "\\" else 1
            part = source[place : place + step]
            text += json.loads(f'"{part}"') if step == 1 and part not in '"\n' else part
            place += step
    yield re.sub(r"\\u([0-9a-f]{4})", lambda found: chr(int(found[1], 16)), text)
    return place + 1


def for_people(text: str) -> bool:
    """Whether a string is words for people, by its looks."""
    bare = text.replace("{}", "").strip()
    looks = re.search(r"[a-z] [A-Za-z(]|^[A-Z][a-z]|[.…?!]$|, [a-z]", bare)
    code = re.search(r"^[#.\[/&]|=>|^M |px\b|rem;|var\(|^[a-z-]+ [a-z-]+$|==|gradient\(", bare)
    return bool(re.search(r"[A-Za-z]{2}", bare) and looks and not code)
