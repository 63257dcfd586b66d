"""Who flew what, and what headings are trusted to: told in the set-up, seen in the report."""

import pytest
from page_driver import WAIT_MS, Scene
from past_flight import write_flight
from playwright.sync_api import expect

pytestmark = pytest.mark.timeout(240)


def test_what_the_set_up_tells_stands_in_the_report(scene: Scene) -> None:
    here = scene.here
    flight = write_flight(here, 120.0, 300.0)
    watched = scene.watch()
    page = watched.page
    page.click("#tab-setup")
    for field, text in (
        ("fact-operator", "A. <Ranger>"),
        ("fact-time_zone", "Asia/Tokyo"),
        ("set-heading-error", "12"),
    ):
        page.fill(f"#{field}", text)
        page.press(f"#{field}", "Tab")
    page.wait_for_function("() => window.uavrt?.store.settings.heading_error_deg === 12")
    expect(page.locator("#fact-time_zone")).to_have_value("Asia/Tokyo")
    page.fill("#fact-time_zone", "Moon/Base")
    page.press("#fact-time_zone", "Tab")
    expect(page.locator("#fact-fault")).to_contain_text("no time zone")
    watched.picture("facts")
    page.reload()
    page.click("#tab-setup")
    expect(page.locator("#fact-operator")).to_have_value("A. <Ranger>")
    expect(page.locator("#fact-time_zone")).to_have_value("Asia/Tokyo")
    expect(page.locator("#set-heading-error")).to_have_value("12")
    page.click("#tab-flights")
    with page.context.expect_page() as opened:
        page.click(f'tr[data-flight="{flight}"] .report')
    body = opened.value.locator("body")
    expect(body).to_contain_text("Operator: A. <Ranger>", timeout=4 * WAIT_MS)
    expect(body).to_contain_text("JST")
    opened.value.close()
