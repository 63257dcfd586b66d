"""The page's texts by id, in every language, and the words for what the server says."""

import json
import re
from collections.abc import Generator, Iterator
from functools import cache
from pathlib import Path

PAGE = Path(__file__).parents[2] / "page/src"
TEXTS: dict[str, dict[str, str]] = {
    path.stem: json.loads(path.read_text(encoding="utf-8"))
    for path in sorted((PAGE / "texts").glob("*.json"))
}
SERVER: dict[str, str] = json.loads((PAGE / "server_texts.json").read_text(encoding="utf-8"))
"""What the server says, by id: English, with ``{}`` for what Python puts in."""
GAP = re.compile(r"\{(\w+)\}")

_SAID = re.compile(r"[^\W\d_]{2} [a-zäöüß]{2}")
_CLAUSE = re.compile(
    r"^(?![/']|[A-Z]:\\)(?:.*\s)?(?:the|this|that|there|is|are|be|has|have|cannot|of|from|and|or|it|its|each|than"
    r"|with)(?:\s|$)",
    re.DOTALL,
)
_SENTENCE_END = re.compile(r"[^\W\d_]{3}[.!?] [A-ZÄÖÜ]")
_UNITS = re.compile(r"\b(?:MHz|UTC|min|CSV|GEOJSON|KML|KMZ|GPX|MGRS|DMS|UTM)\b")


def _bare_length(text: str) -> int:
    return len(text.replace("{}", ""))


def _pattern(text: str) -> re.Pattern[str]:
    form = re.escape(plain(text)).replace(r"\{\}", "{}")
    form = form.replace("{}{}{}", "{}<><>").replace("{}{}", "{}<>")
    return re.compile(form.replace("<>", "((?:, .*?)?)").replace("{}", "(.*?)"), re.DOTALL)


def plain(text: str) -> str:
    """Narrow spaces before units are as good as others."""
    return text.replace("\u202f", " ")


_GERMAN = [(text, TEXTS["de"][name]) for name, text in SERVER.items()]
_WHOLE = {plain(text): words for text, words in _GERMAN}
_PATTERNS = [
    (
        _pattern(text),
        words,
        [bool(re.search(r"[:(] ?$", before)) for before in text.split("{}")[:-1]],
    )
    for text, words in sorted(_GERMAN, key=lambda one: -_bare_length(one[0]))
    if "{}" in text
]
Found = tuple[str, list[str]]
"""Words, and what stayed English in them."""


GOES_ON = "place that nobody has words for. Look for it elsewhere"
"""What a gap is not made for."""


def filled_forms(gap: str) -> list[str]:
    """Each text of the server that has gaps, with this in all of them."""
    return [text.replace("{}", gap) for text in SERVER.values() if "{}" in text]


def in_german(text: str) -> Found:
    """Give a text of the server in German as the page does (`i18n.ts`)."""
    return _find(text) or (text, _remainder(text))


def _find(text: str) -> Found | None:
    middle = text.strip()
    found = _find_bare(middle)
    if found is None:
        return None
    before = text[: len(text) - len(text.lstrip())]
    return before + found[0] + text[len(text.rstrip()) :] if middle else before, found[1]


@cache
def _find_bare(text: str) -> Found | None:
    if plain(text) in _WHOLE:
        return _WHOLE[plain(text)], []
    if not re.search(r"[^\W\d_]", text):
        return None
    if " · " in text:
        return _joined(text.split(" · "), " · ")
    best: Found | None = None
    for found in _ways(text):
        if not found[1]:
            return found
        if best is None or len("".join(found[1])) < len("".join(best[1])):
            best = found
    return best


def _ways(text: str) -> Iterator[Found]:
    for end in re.finditer(r"\. ", text):
        halves = [text[: end.start()], text[end.end() :]]
        if any(_find_bare(half) for half in halves):
            yield _joined(halves, ". ")
    for form, words, quotes in _PATTERNS:
        if match := form.fullmatch(plain(text)):
            found = [
                _find(part)
                or (part, [part] if _SAID.search(part) or _SENTENCE_END.search(part) else [])
                for part in match.groups()
            ]
            strange = any(
                _SENTENCE_END.search(rest) or (not quoted and _CLAUSE.search(rest))
                for (_, left), quoted in zip(found, quotes, strict=True)
                for rest in left
            )
            if not strange:
                yield (
                    _filled(words, [one for one, _ in found]),
                    [rest for _, one in found for rest in one],
                )


def _filled(words: str, parts: list[str]) -> str:
    return GAP.sub(lambda gap: parts[int(gap[1]) - 1], words)


def _joined(parts: list[str], between: str) -> Found:
    found = [in_german(part) for part in parts]
    return between.join(one for one, _ in found), [rest for _, one in found for rest in one]


def _remainder(text: str) -> list[str]:
    return [text] if re.search(r"[^\W\d_]{3}", _UNITS.sub("", text)) else []


def calls(source: str, function: str) -> Iterator[str]:
    """Yield what a function is called with, wherever a TypeScript source calls it."""
    for found in re.finditer(rf"(?<![\w.]){function}\(", source):
        place, depth = found.end(), 1
        while depth:
            if source[place] in "\"'":
                place = source.index(source[place], place + 1)
            depth += {"(": 1, ")": -1}.get(source[place], 0)
            place += 1
        yield source[found.end() : place - 1]


def gap_names(call: str) -> set[str] | None:
    """Return names of the gaps that a call of ``t`` fills, None where they are a variable."""
    _, _, gaps = call.partition(", ")
    if not gaps:
        return set()
    if not gaps.startswith("{"):
        return None
    inside = gaps.strip("{ }")
    while inside != (
        flat := re.sub(r"\([^()]*\)|\[[^\[\]]*\]|\{[^{}]*\}|\"[^\"]*\"", "", inside)
    ):
        inside = flat
    return {part.partition(":")[0].strip() for part in inside.split(",") if part.strip()}


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
