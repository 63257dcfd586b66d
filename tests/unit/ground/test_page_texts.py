"""Every text of the page is in the catalogue, in every language."""

import ast
import inspect
import pkgutil
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from page_texts import CATALOGUE, PAGE, for_people, literals

from uavrt import card
from uavrt.card import Card
from uavrt.computer import bench, checks
from uavrt.config import Settings
from uavrt.ground import fetch, link, web
from uavrt.ground.web import actions

SOURCES = sorted(set(PAGE.glob("*.ts")) - {PAGE / "types.ts", PAGE / "i18n.ts"})
NOT_FOR_PEOPLE = {
    *("Feature", "FeatureCollection", "Point", "LineString", "MultiLineString", "Polygon"),
    *("Content-Type", "If-Match", "Enter", "Etc/UTC", "input, select, textarea"),
    *("Shift+T", "Shift+S", "Shift+X", "Shift+C", "TagInfo.txt", "chip warn serve-vehicle"),
    "{}{} Hz",
}
"""Words of formats, keys and selectors that look like texts."""


def plain(text: str) -> str:
    return text.replace("\u202f", " ").strip()


def parts(text: str) -> Iterator[str]:
    """As the page divides a text: at dots in the middle, each with its own words."""
    for part in plain(text).split(" · "):
        if re.search(r"[A-Za-z]{2}", part.replace("{}", "")):
            yield part.strip()


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
def test_each_text_in_the_sources_has_words(source: Path) -> None:
    written = literals(source.read_text(encoding="utf-8"))
    texts = {part for text in written if for_people(text) for part in parts(text)}
    known = {plain(text) for text in CATALOGUE}
    assert texts - known - NOT_FOR_PEOPLE == set()


def said(module: ModuleType, *functions: str) -> set[str]:
    """Texts that functions of the server return or are called with."""
    found = set()
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in functions:
            found |= {text for one in node.args[1:] for text in texts_of(one)}
        if isinstance(node, ast.FunctionDef) and node.name in functions:
            returned = (one.value for one in ast.walk(node) if isinstance(one, ast.Return))
            found |= {text for one in returned if one is not None for text in texts_of(one)}
    return found


def texts_of(node: ast.expr) -> Iterator[str]:
    match node:
        case ast.Constant(value=str() as text):
            yield text
        case ast.JoinedStr(values=values):
            yield "".join(
                str(one.value) if isinstance(one, ast.Constant) else "{}" for one in values
            )
        case ast.IfExp(body=body, orelse=other):
            yield from texts_of(body)
            yield from texts_of(other)


def has_words(text: str) -> bool:
    shown = text.replace("{}", "7")
    return any(
        re.fullmatch(re.escape(plain(known)).replace(r"\{\}", ".*"), shown)
        for known in CATALOGUE
    )


def test_what_the_server_says_of_buttons_and_checks_has_words() -> None:
    texts = {*actions.ACTIONS.values(), *actions.NOT_NOW.values(), bench.NOISE_REMEDY}
    texts |= said(actions, "_reason") | said(bench, "_good", "_bad")
    assert len(texts) > 50
    assert {text for text in texts if not has_words(text)} == set()


def test_what_a_drones_own_page_says_of_card_and_clock_has_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ill = Card(
        device="/dev/mmcblk0p2",
        kind="ext4",
        read_only=True,
        errors=2,
        written_gb=900.0,
        life_used_tenths=10,
    )
    monkeypatch.setattr(checks, "card_of", lambda _directory: ill)
    found = [checks.check_card(Settings())]
    for off_s, synchronized in ((None, "no"), (0.0, "yes"), (-60.0, "yes")):
        monkeypatch.setattr(checks, "battery_clock_off_s", lambda off_s=off_s: off_s)
        monkeypatch.setattr(card, "battery_clock_off_s", lambda off_s=off_s: off_s)
        monkeypatch.setattr(checks, "_timedatectl", lambda answer=synchronized: answer)
        found.append(checks.check_clock())
    monkeypatch.setattr(card, "wall_ns", lambda: 0)
    found.append(checks.check_clock())
    assert [one.ok for one in found] == [False, False, True, False, False]
    texts = {part for one in found for text in (one.text, one.remedy) for part in parts(text)}
    shown = {text for text in texts if not re.fullmatch(r"[\d: -]+ UTC", text)}
    assert len(shown) > 12
    assert {text for text in shown if not has_words(text)} == set()


FOR_TERMINALS = {"page", "server", "keys"}
"""Modules whose errors end the program before there is a page."""
ASKED_OF = [
    *(one.name for one in pkgutil.iter_modules(web.__path__, f"{web.__name__}.")),
    *(one.name for one in pkgutil.iter_modules(link.__path__, f"{link.__name__}.")),
    *(one.name for one in pkgutil.iter_modules(fetch.__path__, f"{fetch.__name__}.")),
    *("uavrt.ground.session", "uavrt.ground.fleet", "uavrt.computer.first_setup"),
]


@pytest.mark.parametrize("name", ASKED_OF)
def test_errors_that_a_page_is_answered_with_have_words(name: str) -> None:
    """But for those of values that only a script sends wrong (`FormatError`)."""
    if name.rpartition(".")[2] in FOR_TERMINALS:
        return
    raised = ("UsageError", "LinkError", "CommandRefused", "ConfigError", "StepFault")
    texts = set()
    for node in ast.walk(ast.parse(inspect.getsource(import_module(name)))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in raised:
            said = [*node.args[:1], *(one.value for one in node.keywords)]
            texts |= {text for one in said for text in texts_of(one) if " " in text}
    assert {text for text in texts if not has_words(text)} == set()


def test_what_is_put_into_a_text_is_put_into_its_words() -> None:
    for text, words in CATALOGUE.items():
        assert words.strip(), text
        assert text.count("{}") == words.count("{}"), text


def test_a_text_without_words_is_noticed() -> None:
    """The scanner sees texts in templates, also in templates within them."""
    source = 'say(a, `Now ${one ? `and then ${two}` : "or never"}: go`); // "not this one"'
    assert list(literals(source)) == ["and then {}", "or never", "Now {}: go"]
    assert not has_words("Nobody has given words for this")
