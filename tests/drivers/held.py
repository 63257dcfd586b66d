"""Requests of a page whose answers a test holds, to make a race certain."""

from playwright.sync_api import APIResponse, Page, Route


class Held:
    """Requests of a page that match a pattern and a method; the station has handled them.

    With ``answers=False`` they wait before the station sees them.
    """

    def __init__(
        self, page: Page, pattern: str, method: str = "GET", *, answers: bool = True
    ) -> None:
        self._page, self._method, self._answers = page, method, answers
        self._held: list[tuple[Route, APIResponse | None]] = []
        page.route(pattern, self._hold)

    def _hold(self, route: Route) -> None:
        if route.request.method != self._method:
            route.continue_()
            return
        self._held.append((route, route.fetch() if self._answers else None))

    def __len__(self) -> int:
        return len(self._held)

    def wait(self, count: int = 1) -> None:
        """Until so many are held."""
        while len(self._held) < count:
            self._page.wait_for_timeout(20)

    def go(self, place: int = 0) -> None:
        """Let one go, and the page take its answer."""
        route, answer = self._held.pop(place)
        with self._page.expect_event(
            "requestfinished", lambda request: request == route.request
        ):
            if answer is None:
                route.continue_()
            else:
                route.fulfill(response=answer)
        self.settle()

    def settle(self) -> None:
        """Let the page draw what it has."""
        self._page.wait_for_timeout(100)
        self._page.evaluate("() => new Promise((done) => requestAnimationFrame(done))")
