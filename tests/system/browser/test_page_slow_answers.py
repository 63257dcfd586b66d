"""Answers that come late: nothing typed is lost, nothing old shown, no press counts twice."""

import pytest
from held import Held
from page_driver import Scene, open_flight, type_row
from past_flight import write_days, write_flight
from playwright.sync_api import Page, expect
from until import until

from uavrt.config.loader import write_default_settings
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.commands import SystemState

pytestmark = pytest.mark.timeout(240)


def put(page: Page, field: str, text: str) -> None:
    page.fill(field, text)
    page.press(field, "Tab")


def test_what_is_typed_while_the_table_is_saved_stays_and_is_no_conflict(scene: Scene) -> None:
    page = scene.watch().page
    page.click("#tab-setup")
    page.click("#tag-add")
    type_row(page, frequency_mhz=148.71, interval_ms=1254, pulse_width_ms=20)
    held = Held(page, "**/api/tags", "PUT")
    page.click("#tag-save")
    held.wait()
    page.wait_for_function("() => window.uavrt?.store.tags.length === 1")
    held.settle()
    expect(page.locator("#tag-conflict")).to_be_hidden()
    interval = page.locator('input[data-row="0"][data-key="interval_ms"]')
    interval.fill("1333")
    held.go()
    expect(interval).to_have_value("1333")
    expect(page.locator("#tag-state")).to_contain_text("not saved")
    expect(page.locator("#tag-conflict")).to_be_hidden()
    page.click("#tag-save")
    held.wait()
    held.go()
    expect(page.locator("#tag-state")).to_have_text("saved")
    (tag,) = read_tags(scene.here / "tags.toml")
    assert tag.pulse_intervals_s == (1.333,)


def test_what_an_imported_file_loses_stays_named_after_the_table_is_checked(
    scene: Scene,
) -> None:
    page = scene.watch().page
    page.click("#tab-setup")
    expect(page.locator("#tag-import")).to_be_enabled()
    file = scene.here / "sliding.toml"
    file.write_text(
        "[[tag]]\nid = 2\nfrequency_mhz = 148.71\ninterval_ms = 1254\npulse_width_ms = 20\n"
        "frequency_slide_hz = 400\n"
    )
    held = Held(page, "**/api/tags/check", "POST")
    page.set_input_files('input[accept*=".toml"]', str(file))
    held.wait()
    held.go()
    held.settle()
    expect(page.locator("#tag-warnings")).to_have_text(
        "the frequency slides of tags 2 are not sent to the drone"
    )


def test_rows_are_typed_only_after_the_table_has_come(station: Scene) -> None:
    page = station.watch().page
    page.click("#tab-setup")
    buttons = [page.locator(name) for name in ("#tag-add", "#tag-import", "#tag-save")]
    for button in buttons:
        expect(button).to_be_enabled()
    page.add_init_script("window.WebSocket = class {}")
    page.reload()
    expect(page.locator("#link-kind option")).not_to_have_count(0)
    for button in buttons:
        expect(button).to_be_disabled()


def test_of_two_changes_of_a_setting_the_later_one_stands(station: Scene) -> None:
    page = station.watch().page
    page.click("#tab-setup")
    gain = page.locator("#set-gain")
    page.wait_for_function("() => window.uavrt?.store.settings !== null")
    held = Held(page, "**/api/settings", "PUT", answers=False)
    put(page, "#set-gain", "12")
    put(page, "#set-gain", "20")
    held.wait()
    held.settle()
    while len(held):
        held.go(-1)  # if both are under way, the later one overtakes
    expect(gain).to_have_value("20")
    page.wait_for_function("() => window.uavrt?.store.settings.gain === 20")
    assert not len(held)


def test_an_address_that_is_typed_and_the_reason_of_a_refusal_stay(station: Scene) -> None:
    page = station.watch().page
    page.click("#tab-setup")
    put(page, "#link-address", "carrier://pigeon")
    page.select_option("#set-antenna", "H")
    page.wait_for_function("() => window.uavrt?.store.settings.antenna === 'H'")
    address, state = page.locator("#link-address"), page.locator("#link-state")
    expect(address).to_have_value("carrier://pigeon")
    page.click("#link-connect")
    expect(state).to_contain_text("carrier")
    time_ns = page.evaluate("() => window.uavrt.store.state.time_ns")
    page.wait_for_function(f"() => window.uavrt?.store.state.time_ns > {time_ns} + 2e9")
    expect(state).to_contain_text("carrier", timeout=1)


def test_a_fact_that_is_typed_before_the_facts_have_come_stays(station: Scene) -> None:
    page = station.watch().page
    held = Held(page, "**/api/facts")
    page.reload()
    page.click("#tab-setup")
    held.wait()
    put(page, "#fact-operator", "A. Ranger")
    page.wait_for_timeout(500)  # a change that did not wait would be answered by now
    held.go()
    operator = page.locator("#fact-operator")
    expect(operator).to_have_value("A. Ranger")
    page.unroute_all()
    page.wait_for_function(
        "() => fetch('/api/facts').then((one) => one.json()).then((one) => one.operator)"
    )
    expect(operator).to_have_value("A. Ranger", timeout=1)


def test_a_step_of_the_first_set_up_is_not_skipped_by_a_second_press(scene: Scene) -> None:
    config = scene.directory / "drone/uavrt.toml"
    config.parent.mkdir()
    write_default_settings(config)
    scene.start("--set-up", str(config))
    page = scene.watch().page
    page.fill("#wizard-name", "lynx-1")
    held = Held(page, "**/api/set-up/name", "PUT")
    for _ in range(2):
        page.press("#wizard-name", "Enter")
    held.wait()
    held.settle()
    while len(held):
        held.go()
    expect(page.locator(".wizard-steps [aria-current]")).to_have_text("Antenna")


def test_a_tapped_place_keeps_its_own_mgrs_when_another_ones_comes_late(station: Scene) -> None:
    page = station.watch().page
    page.wait_for_function("() => window.uavrt?.store.state !== null")
    held = Held(page, "**/api/readout?*")
    tap = page.locator("#map canvas").first
    tap.click(position={"x": 300, "y": 330})
    held.wait()
    tap.click(position={"x": 420, "y": 200})
    held.wait(2)
    mgrs = page.locator("#tap-mgrs")
    expect(mgrs).to_be_empty()
    held.go(1)
    expect(mgrs).not_to_be_empty()
    second = mgrs.inner_text()
    held.go()
    expect(mgrs).to_have_text(second)


def test_the_two_flights_that_were_chosen_last_are_compared(station: Scene) -> None:
    names = write_days(station.here, 3)
    page = station.watch().page
    page.click("#tab-flights")
    held = Held(page, f"**/api/flights/{names[0]}")
    for name in names[:2]:
        page.check(f'tr[data-flight="{name}"] .tick')
    page.click("#flights-compare")
    held.wait()
    page.check(f'tr[data-flight="{names[2]}"] .tick')
    page.click("#flights-compare")
    head = page.locator(".compared thead")
    expect(head).to_contain_text("2026-05-03")
    held.go()
    expect(head).to_contain_text("2026-05-03")
    expect(head).not_to_contain_text("2026-05-01")


def test_back_to_live_no_position_of_the_past_flight_is_left(station: Scene) -> None:
    flight, drone = write_flight(station.here, 120.0, 300.0), station.drone()
    page = station.watch().page
    drone.state = SystemState.DETECTING
    page.wait_for_function("() => window.uavrt?.store.state?.flight.flight_id")
    open_flight(page, flight)
    expect(page.locator(".fix")).to_have_count(1)
    page.click("#replay-live")
    expect(page.locator("#banner")).to_be_hidden()
    expect(page.locator(".fix")).to_have_count(0)


def test_of_what_was_asked_of_all_vehicles_the_last_answers_are_shown(scene: Scene) -> None:
    scene.start("--vehicle", "2")
    drones = [scene.drone(system_id=number) for number in (1, 2)]
    for drone in drones:
        drone.state = SystemState.HAS_TAGS
    page = scene.watch().page
    for number in (1, 2):
        chip = page.locator(f'.chip.vehicle[data-vehicle="{number}"]')
        expect(chip).to_have_attribute("title", f"vehicle {number}: Ready, 0 pulses")
    held = Held(page, "**/api/vehicles/commands/start", "POST")
    page.click("#all-start")
    held.wait()
    until(lambda: all(drone.state == SystemState.DETECTING for drone in drones))
    page.click("#all-stop")
    answers = page.locator("#all-answers li")
    for place in (0, 1):
        expect(answers.nth(place)).to_contain_text("stopped")
    held.go()
    for place in (0, 1):
        expect(answers.nth(place)).to_contain_text("stopped")
