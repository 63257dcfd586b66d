"""Decide which of several open pages is in command. Pure."""

from collections import Counter

from uavrt.errors import CommandRefused


class Commander:
    """One page commands; the others watch until one of them takes over.

    A page names itself when it opens its records and in what it asks; scripts, which name no
    page, may do what they did. Who commands is the first page that is there, and it stays when
    it is reloaded; when it has gone, whoever asks next.

    `page`: who commanded before a restart in flight.
    """

    def __init__(self, page: str | None = None) -> None:
        self.page = page
        self._there: Counter[str] = Counter()

    @property
    def present(self) -> str | None:
        """The page that commands, while it is there."""
        return self.page if self.page is not None and self._there[self.page] > 0 else None

    def come(self, page: str) -> None:
        """Add a page that has started to listen."""
        self._there[page] += 1
        if self.page is None:
            self.page = page

    def go(self, page: str) -> None:
        """A page listens no more."""
        self._there[page] -= 1
        if self._there[page] <= 0:
            del self._there[page]

    def take(self, page: str) -> None:
        """Let this page command from now on."""
        self.page = page

    def check(self, page: str | None) -> None:
        """Refuse what a page asks that only looks on; raises `CommandRefused`."""
        if page is None or page == self.page:
            return
        if self.present is not None:
            raise CommandRefused(
                "another page has command; this page can only view. Take command first"
            )
        self.page = page
