"""Detect a pilot at the remote control from its sticks and switches; no I/O.

A moved stick means that a pilot flies. The same holds for any switch: PX4's mode switch set to
Hold during a command in Hold changes neither mode nor target.
"""

from uavrt.guidance.control.observed import SticksReport
from uavrt.guidance.safety import SAFETY


class RcWatch:
    """Detects a stick or switch that has moved since the first report.

    One message may be wrong. So a switch counts as moved after two messages, or after one that
    no other contradicts for 0.1 s. `unwatched` are numbers of channels without a control, such
    as one with the RSSI.
    """

    def __init__(self, then: SticksReport, unwatched: frozenset[int]) -> None:
        self._then, self._unwatched = then, unwatched
        self._off_since_s: dict[int, float] = {}

    @property
    def unsure(self) -> bool:
        """True if only one message so far shows that a switch has moved."""
        return bool(self._off_since_s)

    def observe(self, seen: SticksReport) -> str | None:
        """Compare a report with the first one; return what has moved, or None."""
        off = self._elsewhere(seen.switches_us)
        again = [number for number in off if number in self._off_since_s]
        self._off_since_s = {
            number: self._off_since_s.get(number, seen.time_s) for number in off
        }
        now_us, then_us = seen.channels_us, self._then.channels_us
        sticks = zip(now_us, then_us, strict=False)
        if len(now_us) != len(then_us) or any(abs(a - b) > SAFETY.stick_us for a, b in sticks):
            return "the sticks were moved"
        return _switched(again)

    def sure(self, now_s: float) -> str | None:
        """Return which switch has been off its first position for 0.1 s; else None."""
        since_s = self._off_since_s.items()
        return _switched(
            [one for one, at_s in since_s if now_s - at_s >= SAFETY.switch_moved_s]
        )

    def _elsewhere(self, now_us: tuple[int, ...]) -> list[int]:
        then_us = self._then.switches_us
        most = max(len(now_us), len(then_us))
        now, then = (one + (0,) * (most - len(one)) for one in (now_us, then_us))
        return [
            number
            for number, (a, b) in enumerate(zip(now, then, strict=True), SAFETY.first_switch)
            if abs(a - b) >= SAFETY.switch_us and number not in self._unwatched
        ]


def _switched(channels: list[int]) -> str | None:
    """Return a text on the first of the moved channels; None if none has moved."""
    if not channels:
        return None
    unless = "(guidance.unwatched_channels leaves it out)"
    return f"RC channel {min(channels)} was switched {unless}"
