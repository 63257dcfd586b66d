"""Every text of the page has an id, and every language has words for it."""

import ast
import inspect
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from itertools import product
from pathlib import Path
from types import ModuleType

import pytest
from page_texts import (
    GAP,
    GOES_ON,
    PAGE,
    SERVER,
    TEXTS,
    calls,
    filled_forms,
    for_people,
    gap_names,
    in_german,
    literals,
    plain,
)
from virtual_time import VirtualClock

from uavrt.analysis.whole_flights.verdict_words import verdict_facts
from uavrt.config.settings import Settings
from uavrt.core import errors
from uavrt.drone import card
from uavrt.drone.card import Card
from uavrt.drone.computer import bench
from uavrt.drone.computer import computer_checks as checks
from uavrt.flight.integrated import IntegratedPart, IntegratedVerdict, SilentAround
from uavrt.ground.link import button_states as actions

SOURCES = sorted(set(PAGE.rglob("*.ts")) - {PAGE / "types.ts"})
NOT_FOR_PEOPLE = {
    *("Feature", "FeatureCollection", "Point", "LineString", "MultiLineString", "Polygon"),
    *("Content-Type", "If-Match", "Enter", "Etc/UTC", "input, select, textarea"),
    *(f"NavigationControl.{name}" for name in ("ZoomIn", "ZoomOut", "ResetBearing")),
    *("Shift+T", "Shift+S", "Shift+X", "Shift+C", "TagInfo.txt", "chip warn serve-vehicle"),
    "{}{} Hz",
}
"""Words of formats, keys and selectors that look like texts."""
FROM_SERVER = {"No tags", "send it again after"}
"""What the server says that the page looks for."""
SAME_IN_ALL = {
    *("uavrt", "TCP", "UTM", "MGRS", "{} UTC", "{}–{} m", "http://{}.local:{}"),
    *("udp://127.0.0.1:20000", "serial:///dev/ttyAMA0:57600", "flight_log_", "language"),
    *("en", "walk-title", "walk-way"),
}
"""Names and units that need no language."""


def parts(text: str) -> Iterator[str]:
    """As the page divides a text: at dots in the middle, each with its own words."""
    for part in plain(text).strip().split(" · "):
        if re.search(r"[A-Za-z]{2}", part.replace("{}", "")):
            yield part.strip()


@pytest.mark.parametrize("source", SOURCES, ids=lambda path: path.name)
def test_no_text_for_people_stands_in_the_sources(source: Path) -> None:
    written = literals(source.read_text(encoding="utf-8"))
    texts = {part for text in written if for_people(text) for part in parts(text)}
    assert texts - NOT_FOR_PEOPLE - FROM_SERVER == set()


def test_what_is_shown_as_it_is_has_no_words_and_joins_no_texts() -> None:
    written = [
        call
        for source in SOURCES
        for call in calls(source.read_text(encoding="utf-8"), "verbatim")
    ]
    assert len(written) > 50
    shown = {plain(text) for call in written for text in literals(call)}
    words = {text for text in shown if re.search(r"[A-Za-z]{2}", text.replace("{}", ""))}
    assert words - SAME_IN_ALL == set()
    assert [call for call in written if re.search(r"\bt\(", call)] == []


def test_every_id_is_used_and_every_call_fills_the_gaps_of_its_text() -> None:
    english = TEXTS["en"]
    used: set[str] = set()
    for source in SOURCES:
        code = source.read_text(encoding="utf-8")
        used |= {text for text in literals(code) if text in english}
        for call in calls(code, "t"):
            first, gaps = call.partition(", ")[0], gap_names(call)
            for name in set(re.findall(r'"([\w.]+)"', first)) & set(english):
                wanted = set(GAP.findall(english[name]))
                assert gaps is None or wanted <= gaps, (source.name, call)
                assert gaps is None or gaps <= wanted or "?" in first, (source.name, call)
    assert set(english) - used == set()


@pytest.mark.parametrize("language", TEXTS)
def test_a_language_has_each_text_with_its_gaps_and_no_other(language: str) -> None:
    wanted = TEXTS["en"] if language == "en" else TEXTS["en"] | SERVER
    texts = TEXTS[language]
    assert set(texts) == set(wanted)
    for name, text in wanted.items():
        places = map(str, range(1, text.count("{}") + 1))
        gaps = sorted(GAP.findall(text)) if name in TEXTS["en"] else list(places)
        assert texts[name].strip() == texts[name] != "", name
        assert sorted(GAP.findall(texts[name])) == gaps, name


def test_each_text_of_the_server_has_one_id() -> None:
    assert len(set(map(plain, SERVER.values()))) == len(SERVER)
    assert all(name.startswith("server.") for name in SERVER)
    assert not any(name.startswith("server.") for name in TEXTS["en"])


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


def texts_of(node: ast.expr, module: ModuleType | None = None) -> Iterator[str]:
    match node:
        case ast.Name(id=name) if isinstance(text := getattr(module, name, None), str):
            yield text
        case ast.Constant(value=str() as text):
            yield text
        case ast.JoinedStr(values=values):
            for one in product(*map(put_in, values)):
                yield "".join(one)
        case ast.IfExp(body=body, orelse=other):
            yield from texts_of(body, module)
            yield from texts_of(other, module)


def put_in(part: ast.expr) -> list[str]:
    """A part of an f-string: its text, either of two texts, or a gap."""
    match part:
        case ast.Constant(value=value):
            return [str(value)]
        case ast.FormattedValue(value=ast.IfExp() as either):
            return list(texts_of(either)) or ["{}"]
    return ["{}"]


def has_words(text: str) -> bool:
    return not in_german(text.replace("{}", "7"))[1]


def test_what_the_server_says_of_buttons_and_checks_has_words() -> None:
    texts = {
        *actions.ACTIONS.values(),
        *actions.REFUSALS_BY_STATE.values(),
        bench.NOISE_REMEDY,
        bench.LEVEL_REMEDY,
    }
    texts |= said(actions, "_reason") | said(bench, "passed", "_open", "failed")
    assert len(texts) > 50
    assert {text for text in texts if not has_words(text)} == set()


def test_what_a_drones_own_page_says_of_card_and_clock_has_words(
    monkeypatch: pytest.MonkeyPatch, clock_of_test: VirtualClock
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
    monkeypatch.setattr(card, "wall_ns", lambda: card.OLDEST_TIME_NS)
    found = [checks.check_card(Settings())]
    for off_s, synchronized in ((None, "no"), (0.0, "yes"), (-60.0, "yes")):
        monkeypatch.setattr(checks, "battery_clock_off_s", lambda off_s=off_s: off_s)
        monkeypatch.setattr(card, "battery_clock_off_s", lambda off_s=off_s: off_s)
        monkeypatch.setattr(checks, "_timedatectl", lambda answer=synchronized: answer)
        found.append(checks.check_clock())
    clock_of_test.set_wall_ns(0)
    found.append(checks.check_clock())
    assert [one.ok for one in found] == [False, False, True, False, False]
    texts = {part for one in found for text in (one.text, one.remedy) for part in parts(text)}
    shown = {text for text in texts if not re.fullmatch(r"[\d: -]+ UTC", text)}
    assert len(shown) > 12
    assert {text for text in shown if not has_words(text)} == set()


WITHOUT_A_PAGE = {"page_program", "server", "keys", "found_bursts", "mission", "station"}
"""Modules whose errors no page shows, as they end the program or belong to a command."""


def modules_of(name: str) -> Iterator[str]:
    """Name a module, or all modules of a package."""
    module = import_module(name)
    if not hasattr(module, "__path__"):
        yield name
        return
    for one in pkgutil.walk_packages(module.__path__, f"{name}."):
        if one.name.rpartition(".")[2] not in WITHOUT_A_PAGE:
            yield one.name


ASKED_OF = (
    "uavrt.analysis.archive.parquet.questions",
    "uavrt.analysis.covered",
    "uavrt.analysis.inputs",
    "uavrt.analysis.integrated.fold_pictures",
    "uavrt.analysis.season",
    "uavrt.analysis.whole_flights.kept_samples",
    "uavrt.config.tags.tag_files",
    "uavrt.config.text_files",
    "uavrt.drone.computer.first_setup",
    "uavrt.flight.integrated",
    "uavrt.flight.reading.flight_reader",
    "uavrt.ground",
    "uavrt.guidance.files",
    "uavrt.link.mavlink.links",
    "uavrt.localization.antenna",
    "uavrt.localization.estimates.flight_estimates",
    "uavrt.localization.terrain",
    "uavrt.radio.checking",
    "uavrt.radio.receivers",
    "uavrt.radio.udp_address",
)
RAISED = {
    *(name for name, one in vars(errors).items() if isinstance(one, type)),
    *("StepFault", "SettingFault"),
}


@pytest.mark.parametrize("name", [one for name in ASKED_OF for one in modules_of(name)])
def test_errors_that_a_page_is_answered_with_have_words(name: str) -> None:
    module = import_module(name)
    texts = set()
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in RAISED:
            said = [*node.args[:1], *(one.value for one in node.keywords)]
            texts |= {text for one in said for text in texts_of(one, module) if " " in text}
    assert {text for text in texts if any(parts(text)) and not has_words(text)} == set()


REMARKS = {
    "uavrt.analysis.covered.coverage_maps": ("map_around",),
    "uavrt.analysis.covered.flight_coverage": ("_above_ground",),
    "uavrt.analysis.integrated.hindsight": ("_ambiguity",),
    "uavrt.analysis.whole_flights.kept_samples": ("left_out_in_words",),
    "uavrt.analysis.inputs.listening_times": ("missing_in_words", "limits_of"),
    "uavrt.analysis.estimates.position_words": ("remarks_of",),
    "uavrt.analysis.covered.silence": (
        *("_NOT_JUDGED", "_ANTENNA_UNKNOWN", "_NOT_SILENT", "_ANTENNA_ASSUMED", "_AMBIGUOUS"),
    ),
    "uavrt.analysis.whole_flights.judged_flights": ("assumed_in_words", "rest_in_words"),
    "uavrt.localization.estimates.heard": ("height_warning",),
    "uavrt.localization.position.bearings.common_errors": (
        *("UNCHECKED", "UNKNOWN_SIGMAS", "cautions_of", "_cautions_of_odd", "_contradicting"),
    ),
    "uavrt.localization.position.walks": ("caution",),
    "uavrt.localization.results": ("remarks",),
    "uavrt.localization.position.levels.survey_errors": ("cautions_of_survey",),
    "uavrt.localization.terrain.elevation": ("cautions",),
    "uavrt.localization.terrain.hill_losses": ("cautions",),
}
"""What says in words how far a place, a map or a verdict is to be trusted."""
TOGETHER = {
    "uavrt.analysis.integrated.hindsight",
    "uavrt.analysis.whole_flights.judged_flights",
    "uavrt.analysis.inputs.listening_times",
}
"""Their remarks come in one text, and the page divides it at semicolons."""


def remarks_in(name: str, wanted: tuple[str, ...]) -> set[str]:
    """Texts of several words in some functions and constants of a module, but docstrings."""
    found = set()
    seen = set()
    for node in ast.walk(ast.parse(inspect.getsource(import_module(name)))):
        match node:
            case ast.FunctionDef(name=own, body=body) if own in wanted:
                within = body[1:] if ast.get_docstring(node) is not None else body
            case ast.Assign(targets=[ast.Name(id=own)], value=value) if own in wanted:
                within = [ast.Expr(value)]
            case _:
                continue
        seen.add(own)
        whole = [one for part in within for one in ast.walk(part)]
        inner = {
            id(one)
            for text in whole
            if isinstance(text, ast.JoinedStr)
            for one in ast.walk(text)
            if one is not text
        }
        for one in whole:
            if isinstance(one, ast.JoinedStr | ast.Constant) and id(one) not in inner:
                found |= {text for text in texts_of(one) if " " in text.strip()}
    assert seen == set(wanted)
    return found


@pytest.mark.parametrize("name", REMARKS)
def test_what_says_how_far_to_trust_a_place_or_a_map_has_words(name: str) -> None:
    texts = remarks_in(name, REMARKS[name])
    assert texts
    shown = {
        part for text in texts for part in (text.split("; ") if name in TOGETHER else [text])
    }
    assert {text for text in shown if not has_words(text)} == set()


@pytest.mark.parametrize("flights", [1, 3])
@pytest.mark.parametrize("chance", [1e-12, 1e-4, 0.05])
@pytest.mark.parametrize(
    ("radius_m", "arc_deg", "places"),
    [(80.0, 20.0, 1), (80.0, None, 2), (9e3, 20.0, 1), (9e3, 350.0, 1), (80.0, None, 3)],
)
def test_each_result_of_a_whole_flight_has_words(
    flights: int, chance: float, radius_m: float, arc_deg: float | None, places: int
) -> None:
    part = IntegratedPart(
        latitude_deg=1.5, longitude_deg=-2.5, radius95_m=radius_m, probability=0.4
    )
    found = IntegratedVerdict(
        tag_id=2,
        found=True,
        false_alarm_probability=chance,
        interval_s=1.2,
        frequency_hz=150e6,
        bearing_deg=None if arc_deg is None else 30.0,
        arc50_deg=arc_deg,
        arc95_deg=arc_deg,
        latitude_deg=1.5,
        longitude_deg=-2.5,
        radius50_m=radius_m / 2,
        radius95_m=radius_m,
        places=places,
        parts=(part,) * (places % 3),
        flights=flights,
    )
    silences = [
        SilentAround(tag_power_dbm=-50.0, probability=0.9, within_m=near_m, whole_flight=whole)
        for near_m in (None, 230.0)
        for whole in (False, True)
    ]
    missing = [replace(found, found=False, silent=silent) for silent in silences]
    for verdict in (found, *missing):
        facts = verdict_facts(verdict)
        texts = {
            text for label, values in (*facts.rows, *facts.details) for text in (label, *values)
        }
        assert {text for text in texts if not has_words(text)} == set()


def test_a_text_that_goes_on_in_english_is_noticed_whatever_it_begins_with() -> None:
    unnoticed = {text for text in filled_forms(GOES_ON) if not in_german(text)[1]}
    assert unnoticed == set()


def test_a_longer_error_is_not_taken_for_a_shorter_one() -> None:
    text = f"there is no {GOES_ON}"
    assert in_german(text) == (text, [text])
    assert in_german("there is no modem") == ("modem gibt es nicht", [])
    fault = "there is no readable flight in /home/lynx and co or its subfolders"
    lies = "in /home/lynx and co und seinen Unterordnern ist kein lesbarer Flug"
    words, left = in_german(f"{fault}. Name the folder that contains flights")
    assert words == f"{lies}. Den Ordner angeben, in dem Flüge liegen"
    assert left == ["/home/lynx and co"]


def test_a_remedy_has_its_words_also_where_the_fault_has_none() -> None:
    words, left = in_german("the moon is not up. Try again")
    assert (words, left) == (
        "the moon is not up. Noch einmal versuchen",
        ["the moon is not up"],
    )


def test_what_is_quoted_may_be_in_any_language_and_is_noticed() -> None:
    words, left = in_german("cannot change /x/starred: the disk is asleep")
    assert words == "/x/starred lässt sich nicht ändern: the disk is asleep"
    assert left == ["the disk is asleep"]
    assert in_german("cannot change /x/starred: Permission denied")[1] == []


def test_names_of_people_fit_every_gap() -> None:
    assert in_german("1 of 2 detected: alter Luchs") == ("1 von 2 entdeckt: alter Luchs", [])
    assert in_german("cannot run alter Luchs: junger luchs")[0] == (
        "alter Luchs lässt sich nicht starten: junger luchs"
    )


def test_a_text_without_words_is_noticed() -> None:
    """The scanner sees texts in templates, also in templates within them."""
    source = 'say(a, `Now ${one ? `and then ${two}` : "or never"}: go`); // "not this one"'
    assert list(literals(source)) == ["and then {}", "or never", "Now {}: go"]
    assert not has_words("Nobody has given words for this")
