"""The first set-up on the page of a drone's own computer: by keyboard, in German, by axe."""

from typing import Any

import pytest
from page_driver import Scene, axe_findings
from playwright.sync_api import Page, expect
from until import until

from uavrt.config.loader import load_settings, write_default_settings
from uavrt.simulation.demo.demo_programs import free_udp_port

pytestmark = pytest.mark.timeout(240)


def typed(page: Page, *texts: str) -> None:
    """Fill the fields from the one that has the focus on, by keyboard alone."""
    for place, text in enumerate(texts):
        if place:
            page.keyboard.press("Tab")
        page.keyboard.press("Control+a")
        page.keyboard.type(text)


def chosen(page: Page, select: str, letters: str, value: str) -> None:
    """Choose by typing; a busy machine may take the letters for several words."""

    def taken() -> bool:
        page.keyboard.type(letters)
        if page.locator(select).input_value() == value:
            return True
        page.wait_for_timeout(1500)  # a new word begins
        return False

    until(taken, 60.0)


def at(page: Page, step: str) -> None:
    expect(page.locator(".wizard-steps [aria-current]")).to_have_text(step)
    serious = [one for one in axe_findings(page) if one[0] in ("serious", "critical")]
    assert not serious, step


def test_a_drone_is_set_up_by_keyboard_in_german_and_asks_no_more(scene: Scene) -> None:
    config = scene.directory / "drone/uavrt.toml"
    config.parent.mkdir()
    write_default_settings(config)
    scene.start("--set-up", str(config))
    english = scene.watch(locale="en-US")
    expect(english.page.locator("#wizard-title")).to_have_text("First set-up of this computer")
    english.page.fill("#wizard-name", "lynx-1")
    english.picture("first-setup")
    english.page.keyboard.press("Escape")
    expect(english.page.locator("#wizard")).to_be_hidden()
    english.close()
    watched = scene.watch(locale="de-DE")
    page = watched.page
    expect(page.locator("#wizard")).to_be_visible()
    at(page, "Name")
    expect(page.locator("#wizard-name")).to_be_focused()
    typed(page, "Luchs 1")
    page.keyboard.press("Enter")
    expect(page.locator("#wizard-name-fault")).to_contain_text("kleine Buchstaben")
    expect(page.locator("#wizard-name")).to_be_focused()
    typed(page, "luchs-1")
    page.keyboard.press("Enter")
    at(page, "Antenne")
    chosen(page, "#wizard-antenna", "RA-2A", "RA-2A")
    page.keyboard.press("Tab")
    typed(page, "90")
    page.keyboard.press("Enter")
    at(page, "Empfänger")
    chosen(page, "#wizard-kind", "RTL", "rtlsdr")
    expect(page.locator("#wizard-sample_rate_msps")).to_have_value("0.25")
    page.keyboard.press("Tab")
    typed(page, "60")
    page.keyboard.press("Enter")
    expect(page.locator("#wizard-gain-fault")).to_contain_text("von 1 bis 50")
    typed(page, "40")
    page.keyboard.press("Enter")
    # There is none here: it says so and what to do, and lets nobody be stuck.
    expect(page.locator("#wizard-found [data-ok=false]")).to_be_visible()
    expect(page.locator("#wizard-next")).to_have_text("Trotzdem weiter")
    page.keyboard.press("Enter")
    at(page, "Autopilot")
    port = free_udp_port()
    scene.drone(port=port)
    page.keyboard.press("Tab")
    typed(page, f"udpin://127.0.0.1:{port}")
    page.keyboard.press("Tab")
    for _ in range(4):
        if page.evaluate("() => document.activeElement.id") == "wizard-test":
            break
        page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    passed = page.locator("#wizard-found [data-ok=true]")
    expect(passed).to_contain_text("Nachrichten des Autopiloten")
    # A reload costs no step.
    page.reload()
    at(page, "Passwörter und Schlüssel")
    typed(page, "short")
    page.keyboard.press("Enter")
    expect(page.locator("#wizard-page_password-fault")).to_contain_text("8 bis 63")
    typed(page, "marmot-2026", "wild-and-free", "new")
    assert not page.evaluate("() => [...window.uavrt.missing]")
    page.keyboard.press("Enter")
    expect(page.locator("#wizard .wizard-end")).to_contain_text("http://luchs-1.local")
    page.keyboard.press("Enter")
    expect(page.locator("#wizard")).to_be_hidden()
    settings = load_settings(config)
    assert settings.mavlink.address == f"udpin://127.0.0.1:{port}"
    assert (settings.bearings.antenna, settings.antenna.yaw_offset_deg) == ("RA-2A", 90.0)
    assert (settings.radio.kind, settings.radio.gain) == ("rtlsdr", 40)
    handed = (config.parent / "set-up.conf").read_text().splitlines()
    assert handed == [
        "name=luchs-1",
        "page_password=marmot-2026",
        "wifi_password=wild-and-free",
    ]
    with page.expect_response("**/api/set-up") as asked:
        page.reload()
    answer: Any = asked.value.json()
    assert answer == {"wanted": False}
    expect(page.locator("#wizard")).to_have_count(0)
