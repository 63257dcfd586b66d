"""Who is in command: the first station that commanded, until silent for a minute. Pure.

Telemetry radios are open. Whoever commands a flight first is believed (trust on first use)
from its tags to its end; others watch, and take over only with a seal, which proves the drone's
key, or when the first has not been heard for `SILENCE_S`. Names can be chosen by their senders:
this keeps mistakes and mischief out, not an attacker who listens
(docs/how-to/lock-the-link.md).
"""

from collections.abc import Callable

from uavrt.clock import monotonic_s
from uavrt.commands import COMMANDS, Who
from uavrt.messages import Command

SILENCE_S = 60.0
"""A ground station that restarts is back in seconds; a battery is changed in a minute."""
OWN_SOURCES = ("capture", "command line")
"""The supervisor itself, and who started it: at the drone's side."""


class Commander:
    """The station in command.

    `pinned`: False: everybody may command.
    """

    def __init__(
        self,
        *,
        pinned: bool = True,
        clock_s: Callable[[], float] = monotonic_s,
    ) -> None:
        self._pinned = pinned
        self._clock_s = clock_s
        self._heard_s = clock_s()
        self.name: str | None = None
        """Its source, as its commands tell it; None before the first."""
        self.refused = 0
        self._flight_over = False

    def heard(self, source: str, silent_s: float) -> None:
        """Note that somebody was heard, `silent_s` ago."""
        if source == self.name:
            self._heard_s = max(self._heard_s, self._clock_s() - silent_s)

    def refusal(self, command: Command) -> str | None:
        """Explain why a command does not count; None if it does."""
        who = COMMANDS[command.name].who
        if not self._pinned or who is Who.ANYBODY or _is_own(command.source):
            return None
        self.heard(command.source, 0.0)
        if self.name in (None, command.source) or command.sealed:
            return None
        if self._flight_over and who is Who.COMMANDER:
            return None
        left_s = SILENCE_S - (self._clock_s() - self._heard_s)
        if left_s <= 0.0:
            return None
        self.refused += 1
        return (
            f"{self.name} commands, you watch. Seal it with the drone's key, or wait until it "
            f"was silent for {SILENCE_S:.0f} s"
        )

    def flight_ended(self) -> None:
        """Give the next flight to whoever sends tags first."""
        self._flight_over = True

    def accepted(self, command: Command) -> bool:
        """Note a command that was carried out; True when it made a new commander."""
        if COMMANDS[command.name].who is Who.ANYBODY or _is_own(command.source):
            return False
        changed = self.name != command.source
        self._flight_over = self._flight_over and not changed and command.name != "start_tags"
        self.name, self._heard_s = command.source, self._clock_s()
        return changed


def _is_own(source: str) -> bool:
    """Whether a command came from this side: ``command line 4711`` has its process's number."""
    return source.startswith(OWN_SOURCES)
