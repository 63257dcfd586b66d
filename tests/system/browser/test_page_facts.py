"""Who flew what, and what headings are trusted to: told in the set-up, seen in the report."""

from collections.abc import Callable
from pathlib import Path

import pytest
from page_driver import WAIT_MS, Ground, Watched
from past_flight import write_flight
from playwright.sync_api import expect

pytestmark = pytest.mark.timeout(240)


def test_what_the_set_up_tells_stands_in_the_report(
    watch: Callable[..., Watched], start_ground: Callable[..., Ground], tmp_path: Path
) -> None:
    here = tmp_path / "ground"
    here.mkdir()
    flight = write_flight(here, 120.0, 300.0)
    watched = watch(start_ground(tmp_path).address)
    page = watched.page
    page.click("#tab-setup")
    for field, text in (
        ("fact-operator", "A. <Ranger>"),
        ("fact-time_zone", "Asia/Tokyo"),
        ("set-heading-error", "12"),
    ):
        page.fill(f"#{field}", text)
        page.press(f"#{field}", "Tab")
    page.wait_for_function("() => window.uavrt.store.settings.heading_error_deg === 12")
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
