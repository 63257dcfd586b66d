"""Hands on the remote control: sticks, and every other channel of the receiver. Pure.

A stick that moves is a pilot who flies. So is a switch, whatever it does: who flips PX4's mode
switch to Hold while we fly in Hold changes neither the mode nor the target.
"""

from uavrt.guidance.observed import SticksSeen

STICK_US = 60
SWITCH_US = 250
"""Two-way switches go by some 1000 µs, three-way ones by 500."""
SURE_AFTER_S = 0.1
FIRST_SWITCH = 5
"""Number of the first channel after the sticks."""


class SwitchWatch:
    """Whether a switch stands elsewhere than it stood.

    One message may be a receiver's slip; a second one, or 0.1 s without another, is none.

    `then_us`: channels from 5 on, as they stood [µs].
    `unwatched`: numbers of channels that no hand moves, such as one that carries the RSSI.
    """

    def __init__(self, then_us: tuple[int, ...], unwatched: frozenset[int]) -> None:
        self._then_us, self._unwatched = then_us, unwatched
        self._off_since_s: dict[int, float] = {}

    @property
    def unsure(self) -> bool:
        """Whether one has just been seen elsewhere, once."""
        return bool(self._off_since_s)

    def see(self, seen: SticksSeen) -> int | None:
        """Number of a channel that was switched for sure, by what is told now."""
        off = self._elsewhere(seen.switches_us)
        again = [number for number in off if number in self._off_since_s]
        self._off_since_s = {
            number: self._off_since_s.get(number, seen.time_s) for number in off
        }
        return min(again, default=None)

    def sure(self, now_s: float) -> int | None:
        """The same when nothing was told meanwhile."""
        lasting = (
            number
            for number, since_s in self._off_since_s.items()
            if now_s - since_s >= SURE_AFTER_S
        )
        return min(lasting, default=None)

    def _elsewhere(self, now_us: tuple[int, ...]) -> list[int]:
        most = max(len(now_us), len(self._then_us))
        now, then = (one + (0,) * (most - len(one)) for one in (now_us, self._then_us))
        return [
            number
            for number, (a, b) in enumerate(zip(now, then, strict=True), FIRST_SWITCH)
            if abs(a - b) >= SWITCH_US and number not in self._unwatched
        ]


def sticks_moved(seen: SticksSeen, then_us: tuple[int, ...]) -> bool:
    """Whether a stick is elsewhere, of a remote control that is seen."""
    return len(seen.channels_us) == len(then_us) and any(
        abs(now - then) > STICK_US for now, then in zip(seen.channels_us, then_us, strict=True)
    )


def switched(channel: int) -> str:
    """Say which switch was moved, and what to do if it is none."""
    return f"RC channel {channel} was switched (guidance.unwatched_channels leaves it out)"
