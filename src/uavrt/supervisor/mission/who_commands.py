"""Who is in command: the first station that commanded, until silent for a minute. Pure.

Telemetry radios are open. The first station that commands a flight is trusted from its tags to
its end. Others can take over only with a seal, which proves the drone's key, or when the first
has been silent for `SILENCE_S`. Senders choose their own names, so this prevents mistakes and
mischief, not an attack (docs/how-to/lock-the-link.md).
"""

from collections.abc import Callable

from uavrt.clock import monotonic_s
from uavrt.commands import COMMANDS, Who
from uavrt.messages import Command

SILENCE_S = 60.0
"""Silence after which another station may command [s]; longer than a restart."""
OWN_SOURCES = ("capture", "command line")
"""The supervisor itself, and its starter: on the drone's side."""


class Commander:
    """The station in command; without `pinned` every station may command."""

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
        """Source of its commands; None before the first."""
        self.refused = 0
        self._flight_over = False

    def heard(self, source: str, silent_s: float) -> None:
        """Note that a station was received, `silent_s` ago."""
        if source == self.name:
            self._heard_s = max(self._heard_s, self._clock_s() - silent_s)

    def refusal(self, command: Command) -> str | None:
        """Explain why a command is refused; None if it is not."""
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
        """Release the command to the next station that sends tags."""
        self._flight_over = True

    def accepted(self, command: Command) -> bool:
        """Note a command that was carried out; True if it made a new commander."""
        if COMMANDS[command.name].who is Who.ANYBODY or _is_own(command.source):
            return False
        changed = self.name != command.source
        self._flight_over = self._flight_over and not changed and command.name != "start_tags"
        self.name, self._heard_s = command.source, self._clock_s()
        return changed


def _is_own(source: str) -> bool:
    """Whether a command came from this side: ``command line 4711`` has its process's number."""
    return source.startswith(OWN_SOURCES)
