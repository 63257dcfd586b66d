"""Two vehicles on the page: each served, shown and commanded by itself."""

import pytest
from page_driver import Scene
from playwright.sync_api import expect

from uavrt.core.commands import SystemState

pytestmark = pytest.mark.timeout(150)


def test_a_second_vehicle_is_served_and_stopped_without_touching_the_first(
    scene: Scene,
) -> None:
    first = scene.drone()
    watched = scene.watch()
    page = watched.page
    expect(page.locator("#chip-drone")).to_contain_text("40\u202fm")
    expect(page.locator("#vehicles")).to_be_hidden()
    second = scene.drone(system_id=2)
    first.state = second.state = SystemState.DETECTING
    page.click('.serve-vehicle[data-vehicle="2"]')
    expect(page.locator(".chip.vehicle")).to_have_count(2)
    expect(page.locator('.other-vehicle[data-name="vehicle 2"]')).to_be_visible()
    watched.picture("fleet-first")

    page.click('.chip.vehicle[data-vehicle="2"]')
    page.wait_for_url("**/vehicle/2/*")
    expect(page.locator('.chip.vehicle[data-vehicle="2"]')).to_have_attribute(
        "aria-current", "page"
    )
    expect(page.locator('.other-vehicle[data-name="vehicle 1"]')).to_be_visible()
    page.click("#tab-setup")
    page.fill("#set-vehicle-name", "mast")
    page.keyboard.press("Tab")
    expect(page.locator('.chip.vehicle[data-vehicle="2"]')).to_have_text("mast")
    page.click("#tab-fly")
    page.click("#act-stop")
    expect(page.locator("#chip-state")).to_have_text("Ready")
    assert (first.state, second.state) == (SystemState.DETECTING, SystemState.HAS_TAGS)
    watched.picture("fleet-second")
    page.click('.chip.vehicle[data-vehicle="1"]')
    expect(page.locator("#chip-state")).to_have_text("Detecting")


def test_all_vehicles_are_started_and_stopped_and_each_answer_is_shown(
    scene: Scene,
) -> None:
    first = scene.drone()
    watched = scene.watch()
    page = watched.page
    expect(page.locator("#chip-drone")).to_contain_text("40\u202fm")
    expect(page.locator("#to-all")).to_be_hidden()
    second = scene.drone(system_id=2)
    page.click('.serve-vehicle[data-vehicle="2"]')
    expect(page.locator("#to-all")).to_be_visible()
    first.state = SystemState.HAS_TAGS
    for number, state in ((1, "Ready"), (2, "Idle")):
        expect(page.locator(f'.chip.vehicle[data-vehicle="{number}"]')).to_have_attribute(
            "title", f"vehicle {number}: {state}, 0 pulses"
        )
    page.click("#all-start")
    answers = page.locator("#all-answers li")
    expect(answers).to_have_count(2)
    expect(page.locator('#all-answers li[data-vehicle="2"]')).to_contain_text(
        "Send the tags first"
    )
    assert (first.state, second.state) == (SystemState.DETECTING, SystemState.IDLE)
    watched.picture("fleet-to-all")
    second.state = SystemState.DETECTING
    expect(page.locator('.chip.vehicle[data-vehicle="2"]')).to_have_class("chip vehicle live")
    page.click("#all-stop")
    for number in (1, 2):
        expect(page.locator(f'#all-answers li[data-vehicle="{number}"]')).to_contain_text(
            "stopped"
        )
    assert (first.state, second.state) == (SystemState.HAS_TAGS, SystemState.HAS_TAGS)
    page.click("#all-close")
    expect(answers).to_have_count(0)
