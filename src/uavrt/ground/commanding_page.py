"""Decide which of several open web pages may command the vehicle. No I/O."""

from collections import Counter

from uavrt.core.errors import CommandRefused


class CommandingPage:
    """Lets one of the open pages command; the others only watch until one takes command.

    Scripts (page None) always may. The first connected page keeps command when it is reloaded;
    after it has disconnected, the next page that sends a command gets it.
    """

    def __init__(self, page: str | None = None) -> None:
        self.page = page
        self._there: Counter[str] = Counter()

    @property
    def present(self) -> str | None:
        """Name of the commanding page; None while that page is disconnected."""
        return self.page if self.page is not None and self._there[self.page] > 0 else None

    def page_connected(self, page: str) -> None:
        """Add a page that has connected."""
        self._there[page] += 1
        if self.page is None:
            self.page = page

    def page_disconnected(self, page: str) -> None:
        """Remove a page that has disconnected."""
        self._there[page] -= 1
        if self._there[page] <= 0:
            del self._there[page]

    def claim(self, page: str) -> None:
        """Make this page the commanding one."""
        self.page = page

    def check(self, page: str | None) -> None:
        """Raise `CommandRefused` if this page may only watch."""
        if page is None or page == self.page:
            return
        if self.present is not None:
            raise CommandRefused(
                "another page is in command; this page can only view. Take command first"
            )
        self.page = page
