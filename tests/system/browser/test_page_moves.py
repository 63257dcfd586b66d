"""The page moves a simulated drone: asked, held to confirm, and taken back by one tap."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from moved_page import GUIDANCE, MovedPage
from page_driver import Scene, Watched, axe_findings, colour_at
from playwright.sync_api import Browser, Page, expect
from some import some
from tests.system.browser.test_page_hands import MOVING, NO_WEBGL, TARGETS, Hand, in_manual
from until import until

from uavrt.guidance.files.area_text import circle
from uavrt.simulation.vehicle.airframe import Flavour

pytestmark = pytest.mark.timeout(240)
SLIP = """() => ["pointerdown", "pointerup"].forEach((name) =>
  document.querySelector("#hold-to-fly").dispatchEvent(
    new PointerEvent(name, { pointerId: 1, pointerType: "mouse", bubbles: true })))"""
"""A press that is not held, however late a busy test would let it go."""
Field = Callable[[Flavour], MovedPage]


@pytest.fixture
def field(scene: Scene, browser: Browser) -> Iterator[Field]:
    """A drone that hovers, its ground station, and a page."""
    made: list[MovedPage] = []

    def make(flavour: Flavour) -> MovedPage:
        drone = scene.drone(guidance=GUIDANCE, flies=True, flavour=flavour)
        made.append(MovedPage(browser, scene.ground.address, lambda: drone.commands))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_nothing_moves_by_a_tap_and_one_tap_takes_it_back(
    field: Field, flavour: Flavour
) -> None:
    here = field(flavour)
    page = here.page
    page.fill("#move-seconds", "60")
    assert page.evaluate(TARGETS) == []
    assert "turn once to the right" in here.ask()
    here.watched.picture(f"move-offer-{flavour}")
    assert page.evaluate(TARGETS) == []
    page.hover("#hold-to-fly")
    page.evaluate(SLIP)
    page.wait_for_timeout(500)
    assert here.commands() == 0
    expect(page.locator("#motion-standing")).to_have_text("The pilot flies")
    page.click("#offer-leave")
    page.click("#show-tags")
    hand = Hand(page)
    hand.click("#show-move")
    here.fly(hand)
    took = {"turn the drone here": hand.took()}
    expect(page.locator("#motion-text")).to_contain_text("turn once")
    here.watched.picture(f"move-turning-{flavour}")
    page.click("#tab-log")  # from every view
    expect(page.locator("#take-back")).to_be_in_viewport(ratio=1.0)
    hand.click("#take-back")
    expect(page.locator("#motion-standing")).to_have_text("The pilot flies")
    took["take the drone back"] = hand.took()
    in_list = in_manual()
    assert took == {task: in_list[task] for task in took}
    assert max(in_list[task] for task in MOVING) <= 3
    sent = here.commands()
    assert sent >= 1
    page.wait_for_timeout(6000)
    assert here.commands() == sent


def test_an_offer_that_another_page_takes_away_is_said_to_be_no_longer_valid(
    field: Field,
) -> None:
    here = field("px4")
    here.ask()
    other = Watched(here.browser, here.address, color_scheme="light")
    other.page.click("#take-back")
    expect(here.page.locator("#offer")).to_be_hidden()
    expect(here.page.locator("#move-fault")).to_have_text(
        "The proposal has expired. Press Request motion again."
    )
    other.close()


def test_sticks_that_are_not_seen_must_be_known_of(field: Field) -> None:
    here = field("px4")
    here.page.click("#move-hold")
    # As when a flight begins and when the link returns: what is open stays open.
    here.page.evaluate("() => window.uavrt.store.loadLive()")
    here.ask()
    here.hold()
    expect(here.page.locator("#move-fault")).to_contain_text("sticks are not received")
    assert here.commands() == 0


def kml_of(places: tuple[tuple[float, float], ...]) -> str:
    corners = " ".join(f"{east},{north}" for north, east in places)
    return (
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><Polygon><outerBoundaryIs>'
        f"<LinearRing><coordinates>{corners}</coordinates></LinearRing></outerBoundaryIs>"
        "</Polygon></Placemark></kml>"
    )


def ring_around(page: Page, radius_m: float) -> tuple[tuple[float, float], ...]:
    place = page.evaluate("() => window.uavrt.store.state.home")
    return circle((place["latitude_deg"], place["longitude_deg"]), radius_m)


def test_an_area_is_imported_drawn_and_surveyed_and_any_page_takes_it_back(
    field: Field, tmp_path: Path
) -> None:
    here = field("px4")
    page = here.page
    area = tmp_path / "meadow.kml"
    area.write_text(kml_of(ring_around(page, 120.0)), encoding="utf-8")
    page.click("#show-tags")
    hand = Hand(page)
    hand.click("#show-move")
    hand.click("#move-survey")
    hand.give("#area-import", area)
    expect(page.locator("#move-hint")).to_have_text("Area with 20 corners.")
    expect(page.locator("#move-plan")).to_contain_text("from home")
    took = {"see the path over an imported area": hand.took()}
    lines = page.locator("#move-plan").inner_text()
    page.select_option("#move-pattern", "around")
    expect(page.locator("#move-plan")).not_to_have_text(lines)
    here.watched.picture("move-around")
    page.select_option("#move-pattern", "lines")
    expect(page.locator("#move-plan")).to_have_text(lines)
    assert page.evaluate(TARGETS) == []
    here.watched.picture("move")
    assert "survey 4 lines" in here.fly(hand)
    took["fly the path that is shown"] = hand.took()
    assert took == {task: in_manual()[task] for task in took}
    page.wait_for_function("() => window.uavrt?.store.state.motion.way.length > 4")
    page.wait_for_timeout(3000)
    here.watched.picture("move-flying")

    watching = Watched(here.browser, here.address, color_scheme="light")
    expect(watching.page.locator("#take-command")).to_be_visible()
    watching.page.click("#show-move")
    expect(watching.page.locator("#move-ask")).to_have_text("Another page is in command")
    watching.page.click("#take-back")
    expect(page.locator("#motion-standing")).to_have_text("The pilot flies")
    assert watching.errors == []
    watching.close()

    # By hand: corners, then a circle; too far for the fence, which the drone says.
    page.click("#area-clear")
    for x, y in ((560, 330), (700, 330), (700, 430)):
        page.locator("#map canvas").first.click(position={"x": x - 290, "y": y - 110})
    expect(page.locator("#move-hint")).to_have_text("Area with 3 corners.")
    page.click("#area-circle")
    for x, y in ((300, 230), (340, 230)):
        page.locator("#map canvas").first.click(position={"x": x, "y": y})
    expect(page.locator("#move-hint")).to_have_text("Area with 20 corners.")
    area.write_text(kml_of(ring_around(page, 900.0)), encoding="utf-8")
    page.set_input_files("#area-import", str(area))
    expect(page.locator("#move-plan")).to_contain_text("km")
    page.click("#move-ask")
    expect(page.locator("#move-fault")).to_contain_text("beyond the fence")
    area.write_text("no area", encoding="utf-8")
    page.set_input_files("#area-import", str(area))
    expect(page.locator("#move-fault")).to_contain_text("contains no usable area")


def test_before_a_flight_the_page_maps_where_a_tag_would_be_heard(
    field: Field, tmp_path: Path
) -> None:
    here = field("px4")
    page = here.page
    area = tmp_path / "meadow.kml"
    area.write_text(kml_of(ring_around(page, 120.0)), encoding="utf-8")
    for flat in (False, True):
        if flat:
            page.add_init_script(f"({NO_WEBGL})()")
            page.reload()
            expect(page.locator(".flat-map")).to_be_visible()
            page.click("#show-move")
        expect(page.locator("#before")).to_be_hidden()
        page.click("#move-survey")
        page.set_input_files("#area-import", str(area))
        expect(page.locator("#move-plan")).not_to_be_empty()
        page.locator("#before summary").focus()
        page.keyboard.press("Enter")
        assert page.evaluate(TARGETS) == []
        page.fill("#before-power", "much")
        page.click("#before-make")
        expect(page.locator("#before-fault")).to_contain_text("must be a number")
        page.fill("#before-power", "-60")
        page.fill("#before-heights", "30 90")
        box = some(page.locator("#map").bounding_box())
        at = (round(box["x"] + 0.2 * box["width"]), round(box["y"] + 0.8 * box["height"]))
        bare = colour_at(page, *at)
        page.locator("#before-make").focus()
        page.keyboard.press("Enter")
        told = page.locator("#before-status")
        expect(told).to_contain_text("on average", timeout=60_000)
        expect(told).to_contain_text("Best height: ")
        expect(told).to_contain_text("the ground is assumed to be level")
        assert [one for one in axe_findings(page) if one[0] in ("serious", "critical")] == []
        here.watched.picture("before-flat" if flat else "before")
        until(lambda: colour_at(page, *at) != bare)  # noqa: B023 - called here alone
        page.click("#before-hide")
        expect(told).to_be_empty()
        until(lambda: colour_at(page, *at) == bare)  # noqa: B023
        page.click("#before-make")
        expect(told).to_contain_text("on average", timeout=60_000)
        page.select_option("#move-pattern", "around")  # another plan, not that of the map
        expect(told).to_be_empty()
    assert here.commands() == 0


def test_it_goes_where_the_map_is_tapped(field: Field) -> None:
    here = field("ardupilot")
    page = here.page
    page.click("#move-goto")
    page.fill("#move-height", "45")
    page.locator("#map canvas").first.click(position={"x": 380, "y": 260})
    expect(page.locator("#move-hint")).to_contain_text("Destination: ")
    here.watched.picture("move-goto")
    told = here.fly()
    assert "fly to" in told
    assert "at 45 m" in told
    expect(page.locator("#motion-text")).to_contain_text("fly to")
    page.click("#take-back")
    expect(page.locator("#motion-standing")).to_have_text("The pilot flies")


def test_a_drone_without_guidance_shows_no_motion(scene: Scene) -> None:
    watched = scene.watch()
    expect(watched.page.locator("#act-reason")).to_contain_text("No contact")  # it is alive
    watched.page.click("#show-move")
    expect(watched.page.locator("#move-none")).to_be_visible()
    expect(watched.page.locator("#move-form")).to_be_hidden()
    expect(watched.page.locator("#motion-bar")).to_be_hidden()
