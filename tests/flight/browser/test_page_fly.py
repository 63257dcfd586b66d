"""The page lets real processes search with a simulated drone, and takes it back."""

import time

import pytest
from moved_page import GUIDANCE, MovedPage
from page_driver import VIDEO, Scene, type_tags
from playwright.sync_api import Browser, expect
from tests.flight.conftest import DroneBay
from tests.flight.test_search import animal
from tests.system.browser.test_page_hands import TARGETS

from uavrt.config.settings import GuidanceSettings

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900 if VIDEO else 240)]
OURS = "1/191"
FOUND_MS = 200_000
"""In which the animal is found."""


def test_a_search_is_refused_without_tags_and_watched_with_them(
    drone_bay: DroneBay, browser: Browser, scene: Scene
) -> None:
    """``make video`` films it to its end."""
    scenario = animal()
    drone = drone_bay.launch(
        scenario,
        flies=True,
        autopilot_options=("--flavour", "px4"),
        guidance=GuidanceSettings(enabled=True, **GUIDANCE),
    )
    scene.link_port = drone.ground_port

    def commands() -> int:
        text = (drone.directory / "autopilot.log").read_text(errors="replace")
        return sum("motion" in line and OURS in line for line in text.splitlines())

    here = MovedPage(browser, scene.ground.address, commands)
    page, watched = here.page, here.watched
    watched.film()
    watched.caption("A search: the drone decides where to fly. First it says what is missing.")
    page.click("#move-search")
    assert page.evaluate(TARGETS) == []
    page.fill("#move-radius", "130")
    page.fill("#move-accuracy", "40")
    watched.picture("move-search")
    for _ in range(10):
        page.click("#move-ask")
        expect(page.locator("#move-fault:not(:empty)")).to_have_count(1)
        if "no home" not in page.locator("#move-fault").inner_text():
            break
        time.sleep(1.0)
    told = page.locator("#move-fault").inner_text()
    assert "tag" in told or "detect" in told, told
    assert here.commands() == 0

    watched.caption("So: the tags, and detection.", 2.0)
    type_tags(page, scenario)
    page.click("#tag-save")
    expect(page.locator("#tag-state")).to_have_text("saved")
    page.click("#tab-fly")
    page.click("#show-tags")
    page.click("#act-send_tags")
    expect(page.locator("#act-send_tags")).to_contain_text("Tags sent")
    page.click("#show-move")
    page.click("#act-start")
    expect(page.locator("#chip-state")).to_have_text("Detecting")
    # The page loads the flight that has begun, and what is done meanwhile stays open.
    page.wait_for_function("() => window.uavrt?.store.liveFlight !== null")
    expect(page.locator("#move-ask")).to_be_visible()
    watched.caption("Asked again, it says what it would do. Nothing moves until it is held.")
    assert "search" in here.fly()
    watched.caption("Each flight and turn comes with its reason.", 1.0)
    expect(page.locator("#motion-text")).to_contain_text("to learn more about tag")
    watched.picture("move-searching")
    if VIDEO:
        standing = page.locator("#motion-standing")
        expect(standing).to_have_text("The pilot flies", timeout=FOUND_MS)
        watched.caption("Found as surely as was wished: the autopilot flies home.")
    else:
        page.click("#take-back")
        expect(page.locator("#motion-standing")).to_have_text("The pilot flies")
    watched.caption("", 1.0)
    watched.save_film(browser)
    here.close()
