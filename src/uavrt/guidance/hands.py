"""Hands on the remote control: sticks, and every other channel of the receiver. Pure.

A stick that moves is a pilot who flies. So is a switch, whatever it does: who flips PX4's mode
switch to Hold while we fly in Hold changes neither the mode nor the target.
"""

from uavrt.guidance.observed import SticksSeen
from uavrt.guidance.safety import SAFETY


class HandWatch:
    """Says whether a stick or a switch stands elsewhere than it stood.

    One message may be a receiver's slip of a switch; a second one, or 0.1 s without another, is
    none.

    `unwatched`: numbers of channels that no hand moves, such as one that carries the RSSI.
    """

    def __init__(self, then: SticksSeen, unwatched: frozenset[int]) -> None:
        self._then, self._unwatched = then, unwatched
        self._off_since_s: dict[int, float] = {}

    @property
    def unsure(self) -> bool:
        """Whether a switch has just been seen elsewhere, once."""
        return bool(self._off_since_s)

    def see(self, seen: SticksSeen) -> str | None:
        """Say what was moved for sure, by what is reported now."""
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
        """Say which switch was moved for sure when nothing was reported meanwhile."""
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
    """Say which switch was moved, and what to do if it is none."""
    if not channels:
        return None
    unless = "(guidance.unwatched_channels leaves it out)"
    return f"RC channel {min(channels)} was switched {unless}"
