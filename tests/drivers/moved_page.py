"""A page that moves a drone: asked, held to confirm."""

import time
from collections.abc import Callable
from typing import Any, Protocol

from page_driver import Watched
from playwright.sync_api import Browser, Page, expect
from some import some

GUIDANCE: dict[str, Any] = {"battery_wh": 200.0, "speed_m_s": 8.0}


class Hand(Protocol):
    """What counts a person's presses."""

    clicks: int


class MovedPage:
    """The page of a ground station that has found a drone which takes orders.

    `address`: of the page.
    `commands`: number of commands of motion that the drone has given to its autopilot.
    """

    def __init__(self, browser: Browser, address: str, commands: Callable[[], int]) -> None:
        self.browser, self.address, self.commands = browser, address, commands
        self.watched = Watched(browser, address, color_scheme="light")
        self.page: Page = self.watched.page
        expect(self.page.locator("#motion-bar")).to_be_visible()
        self.page.wait_for_function("() => window.uavrt?.store.state.home !== null")
        self.page.wait_for_function("() => window.uavrt?.store.state.vehicle !== null")
        self.page.click("#show-move")

    def ask(self) -> str:
        """Ask until the drone is ready to say what it would fly: at first it has no home."""
        offer = self.page.locator("#offer")
        for _ in range(20):
            self.page.click("#move-ask")
            expect(self.page.locator("#offer:visible, #move-fault:not(:empty)")).to_have_count(
                1
            )
            if offer.is_visible():
                return str(self.page.locator("#offer-text").inner_text())
            time.sleep(1.0)
        raise AssertionError(self.page.locator("#move-fault").inner_text())

    def hold(self) -> None:
        box = some(self.page.locator("#hold-to-fly").bounding_box())
        self.page.mouse.move(box["x"] + 20.0, box["y"] + 20.0)
        self.page.mouse.down()
        expect(self.page.locator("#offer")).to_be_hidden()
        self.page.mouse.up()

    def fly(self, hand: Hand | None = None) -> str:
        """Ask, know that no sticks are seen, and hold; until it flies.

        Of a person's presses the two count that there would be, were the drone ready.
        """
        if hand is not None:
            hand.clicks += 2
        for _ in range(5):
            offered = self.ask()
            self.page.check("#sticks-unseen")
            self.hold()
            bar = self.page.locator('#motion-bar[data-standing="in command"]')
            fault = self.page.locator("#move-fault:not(:empty)")
            expect(bar.or_(fault).first).to_be_visible()
            if bar.is_visible():
                return offered
        raise AssertionError(self.page.locator("#move-fault").inner_text())

    def close(self) -> None:
        assert self.watched.errors == []
        self.watched.close()
