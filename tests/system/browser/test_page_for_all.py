"""The page for all: by axe's rules, by keyboard alone, in German, with longer texts."""

import io
import json
import re
from collections.abc import Iterator
from itertools import chain
from typing import Any

import pytest
from moved_page import GUIDANCE
from page_driver import Scene, axe_findings
from page_texts import GOES_ON, SERVER, TEXTS, filled_forms, in_german
from past_flight import write_flight
from PIL import Image
from playwright.sync_api import Page, expect
from zxingcpp import read_barcodes

from uavrt.config.tags.tag_files import write_tags
from world import THESIS_TAG

pytestmark = pytest.mark.timeout(240)

VIEWS = ("fly", "plots", "setup", "log", "flights", "check")
CONTROLS = """() => [...document.querySelectorAll(
  "button, a[href], input, select, textarea, summary, [tabindex='0'], canvas[tabindex]")]
  .filter((one) => one.checkVisibility({ visibilityProperty: true }) && !one.disabled)
  .filter((one) => one.tabIndex >= 0 && one.getBoundingClientRect().width > 0)
  .map((one) => { one.dataset.walked ??= String(window.walked = (window.walked ?? 0) + 1);
    return [one.dataset.walked, one.id || one.className || one.textContent]; })"""
FOCUSED = """() => { const one = document.activeElement; const style = getComputedStyle(one);
  const seen = style.outlineStyle !== "none" || style.boxShadow !== "none";
  return [one.dataset.walked ?? null, seen]; }"""


CLIPPED = """() => [...document.querySelectorAll("button, .tab, .chip, .check-name")]
  .filter((one) => one.checkVisibility() && one.scrollWidth > one.clientWidth + 1)
  .map((one) => one.textContent)"""
STICKING_OUT = """() => [...document.querySelectorAll("body *")]
  .filter((one) => one.childElementCount === 0 && one.textContent.trim())
  .filter((one) => one.checkVisibility({ visibilityProperty: true }))
  .filter((one) => !one.closest(".hidden-word, .skip, .table-wrap, svg, option"))
  .filter((one) => { const { width, left, right } = one.getBoundingClientRect();
    return width > 1 && (left < -1 || right > innerWidth + 1); })
  .map((one) => one.textContent)"""
PHONE_PX = 390
SLOW_FRAMES = """() => { const burn = () => { const end = performance.now() + 40;
  while (performance.now() < end); requestAnimationFrame(burn); };
  requestAnimationFrame(burn); }"""


def furnished(scene: Scene, **world: Any) -> Scene:
    """All that fills a view: two past flights, a tag, and a drone that is heard."""
    for east_m in (120.0, 150.0):
        write_flight(scene.here, east_m, 300.0)
    write_tags(scene.here / "tags.toml", [THESIS_TAG])
    scene.drone(**world)
    return scene


@pytest.fixture(scope="module", autouse=True)
def furnished_once(lasting: Scene) -> None:
    furnished(lasting)


def ready(page: Page) -> None:
    expect(page.locator("#chip-state")).not_to_have_class("chip bad")
    page.wait_for_function("() => window.uavrt?.store.tags.length === 1")


def states(page: Page) -> Iterator[str]:
    """Go through the views, and what opens in them."""
    for view in VIEWS:
        page.click(f"#tab-{view}")
        if view == "flights":
            page.click("#season-show")
            expect(page.locator("[data-animal]")).to_have_count(1)
            expect(page.locator("tr[data-flight] a", has_text="CSV")).to_have_count(2)
            for tick in page.locator(".tick").all():
                tick.check()
            page.click("#flights-compare")
            expect(page.locator("#compare table")).to_be_visible()
        if view == "check":
            expect(page.locator(".check-row")).to_have_count(8)
        yield view
    page.click("#tab-fly")
    page.click("#show-move")
    page.locator(".layers summary").click()
    yield "move and layers"
    page.locator(".layers summary").click()
    page.click("#tab-flights")
    page.locator(".open-flight").first.click()
    expect(page.locator("#banner")).to_be_visible()
    page.wait_for_function("() => window.uavrt?.store.positions.length > 0")
    yield "past flight"
    page.click("#show-after")
    yield "after"
    page.click("#tab-plots")
    yield "plots of it"


@pytest.mark.parametrize(("scheme", "locale"), [("light", "en-US"), ("dark", "de-DE")])
def test_no_view_has_a_serious_finding_of_axe_or_a_text_cut_off_or_in_another_language(
    station: Scene, scheme: str, locale: str
) -> None:
    watched = station.watch(color_scheme=scheme, locale=locale, plain_map=False)
    page = watched.page
    expect(page.locator("html")).to_have_attribute("lang", locale[:2])
    ready(page)
    found: list[Any] = []
    missing: set[tuple[str, str]] = set()
    for state in states(page):
        found += [(state, *one) for one in axe_findings(page)]
        found += [(state, "serious", "cut off", one) for one in page.evaluate(CLIPPED)]
        untold = page.evaluate("() => [...window.uavrt.missing]")
        missing |= {(state, text) for text in untold}
        page.evaluate("() => window.uavrt.missing.clear()")
    bad = [one for one in found if one[1] in ("serious", "critical")]
    assert not bad, json.dumps(bad, indent=1)
    assert not missing, json.dumps(sorted(missing), indent=1, ensure_ascii=False)


def longer(text: str) -> str:
    """Lengthen each word by 40 %, but no gap, address or number."""
    numbers = iter(range(1, 99))
    text = re.sub(r"\{\}", lambda _: f"{{{next(numbers)}}}", text)
    grown = r"(?<![\w{/:.-])[^\W\d_]{2,}(?![\w}/:.-]*[/:}])"
    return re.sub(grown, lambda word: word[0] + word[0][-1] * -(-2 * len(word[0]) // 5), text)


def motions(page: Page) -> Iterator[str]:
    """Go through what a drone can be asked to fly."""
    page.click("#tab-fly")
    page.click("#show-move")
    expect(page.locator(".kind").nth(1)).to_be_visible()
    for kind in page.locator(".kind").all():
        kind.click()
        yield f"move: {kind.inner_text()}"
    page.click("#show-tags")


def test_texts_that_are_longer_by_two_fifths_break_no_view_of_a_phone(scene: Scene) -> None:
    """The language's file, fetched by the page, is replaced."""
    furnished(scene, guidance=GUIDANCE, flies=True)
    texts = {name: longer(text) for name, text in (TEXTS["en"] | SERVER).items()}
    watched = scene.watch(locale="de-DE", plain_map=False)
    page = watched.page
    page.set_viewport_size({"width": PHONE_PX, "height": 844})
    body = f"export default {json.dumps(texts)}"
    page.route(
        "**/assets/de-*.js",
        lambda route: route.fulfill(content_type="text/javascript", body=body),
    )
    page.reload()
    expect(page.locator("#tab-flights")).to_have_text("Flightssss")
    ready(page)
    expect(page.locator("#motion-bar")).to_be_visible()
    bad: list[Any] = []
    for state in chain(motions(page), states(page)):
        bad += [
            (state, *one) for one in axe_findings(page) if one[0] in ("serious", "critical")
        ]
        bad += [(state, "cut off", one) for one in page.evaluate(CLIPPED)]
        bad += [(state, "sticks out", one) for one in page.evaluate(STICKING_OUT)]
        wide = page.evaluate("() => document.documentElement.scrollWidth")
        bad += [(state, "wide", wide)] if wide > PHONE_PX else []
    assert not bad, json.dumps(bad, indent=1, ensure_ascii=False)


def test_a_fresh_stations_season_says_in_german_what_is_wrong_and_what_to_do(
    scene: Scene,
) -> None:
    watched = scene.watch(locale="de-DE")
    page = watched.page
    page.click("#tab-flights")
    page.click("#season-show")
    note = page.locator("#season-note")
    expect(note).to_contain_text("ist kein lesbarer Flug. Den Ordner angeben, in dem Flüge")
    assert page.evaluate("() => [...window.uavrt.missing]") == []


def test_the_page_finds_the_words_that_the_tests_find(station: Scene) -> None:
    watched = station.watch(locale="de-DE")
    texts = [*filled_forms("7"), *filled_forms(GOES_ON), *filled_forms("link. Try again")]
    texts += [
        "the drone did not answer a request about x. Nobody has words for this",
        GOES_ON,
        "17 m · not detected · new",
    ]
    watched.page.wait_for_function("() => window.uavrt !== undefined")
    said = watched.page.evaluate(
        """texts => texts.map((text) => {
          window.uavrt.missing.clear();
          return [window.uavrt.fromServer(text), [...window.uavrt.missing]];
        })""",
        texts,
    )
    ours = [(words, list(dict.fromkeys(left))) for words, left in map(in_german, texts)]
    assert [(words, left) for words, left in said] == ours


def test_every_control_is_reached_by_the_tab_key_and_shows_the_focus(station: Scene) -> None:
    watched = station.watch(plain_map=False)
    page = watched.page
    ready(page)
    lost: list[tuple[str, str]] = []
    dark: list[tuple[str, str]] = []
    for state in states(page):
        controls = dict(page.evaluate(CONTROLS))
        page.evaluate("() => document.activeElement.blur()")
        page.mouse.move(0, 0)
        reached: dict[str, bool] = {}
        for _ in range(2 * len(controls) + 10):
            page.keyboard.press("Tab")
            number, shown = page.evaluate(FOCUSED)
            if number is not None:
                reached[number] = shown
        lost += [(state, controls[one]) for one in controls if one not in reached]
        dark += [(state, controls[one]) for one in controls if not reached.get(one, True)]
    assert not lost
    assert not dark


def test_a_flight_is_begun_and_a_place_tapped_by_keyboard_alone(scene: Scene) -> None:
    page = furnished(scene).watch(plain_map=False).page
    ready(page)
    page.click("#tab-setup")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    expect(page.locator("#view-fly")).to_be_visible()
    for name, label in (("send_tags", "Tags sent"), ("start", "Detecting")):
        expect(page.locator(f"#act-{name}")).to_be_enabled()
        page.focus(f"#act-{name}")
        page.keyboard.press("Enter")
        expect(
            page.locator("#act-send_tags, #chip-state").filter(has_text=label)
        ).to_be_visible()
    page.focus("#map canvas")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    expect(page.locator("#tap-place")).to_contain_text("46.500")
    page.focus("#act-stop")
    page.keyboard.press("Enter")
    expect(page.locator("#chip-state")).to_have_text("Ready")


def test_a_map_that_is_drawn_slowly_is_moved_by_keyboard_again_and_again(
    station: Scene,
) -> None:
    """Each move begins with a coarser picture, which must not be drawn within a frame."""
    page = station.watch(plain_map=False).page
    page.click("#tab-fly")
    page.evaluate(SLOW_FRAMES)
    page.focus("#map canvas")
    for _ in range(4):
        page.keyboard.down("ArrowRight")
        page.wait_for_timeout(700)
        page.keyboard.up("ArrowRight")
        page.wait_for_timeout(500)


def test_the_language_that_is_chosen_is_kept(station: Scene) -> None:
    watched = station.watch(locale="de-DE")
    page = watched.page
    expect(page.locator("#tab-setup")).to_have_text("Einrichten")
    page.click("#tab-setup")
    page.select_option("#set-language", "en")
    expect(page.locator("#tab-setup")).to_have_text("Set-up")
    page.reload()
    expect(page.locator("#tab-setup")).to_have_text("Set-up")
    expect(page.locator("html")).to_have_attribute("lang", "en")


def test_a_phone_reads_the_way_to_the_page_and_its_wi_fi(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    wi_fi = "WIFI:T:WPA;S:lynx-1;P:k7m2p9x4w3q8;;"
    monkeypatch.setenv("UAVRT_GROUND_PASSWORD", "marmot-7")
    monkeypatch.setenv("UAVRT_ACCESS_POINT", wi_fi)
    scene.start("--listen", "0.0.0.0", "--host-name", "lynx-1.local")
    address = f"http://127.0.0.1:{scene.ground.port}/"
    watched = scene.watch(address, color_scheme="dark")
    page = watched.page
    page.fill("input[type=password]", "marmot-7")
    page.keyboard.press("Enter")
    page.click("#tab-setup")
    read = {}
    for what in ("page", "access point"):
        picture = page.locator(f'[data-door="{what}"] img')
        expect(picture).to_be_visible()
        picture.evaluate("(one) => one.decode()")
        (code,) = read_barcodes(Image.open(io.BytesIO(picture.screenshot())).convert("L"))
        read[what] = code.text
    assert read == {"page": f"http://lynx-1.local:{scene.ground.port}/", "access point": wi_fi}
