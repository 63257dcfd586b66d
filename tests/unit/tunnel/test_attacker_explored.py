"""Every order of an attacker's steps on the link of a drone with a key, to a depth.

``UAVRT_LINK_DEPTH`` sets the depth; each step more takes nine times as long.
"""

import os
from collections.abc import Callable
from itertools import product

from virtual_time import follow

from uavrt.errors import LinkError, TunnelError
from uavrt.tunnel.gate import Sealer
from uavrt.tunnel.seal import (
    ALIVE_INSIDE,
    MOTION_INSIDE,
    Key,
    SealKeeper,
    alive_of,
    session_of,
)

DEPTH = int(os.environ.get("UAVRT_LINK_DEPTH", "4"))
KEY = Key(bytes(range(32)))
GROUND, DRONE = (254, 190), (1, 191)
YESTERDAY = SealKeeper(KEY, 99)


class Link:
    """A station, a drone, and what is between; the attacker keeps all that it ever saw."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self._numbers = iter(range(1, 1000))
        self.station = Sealer(KEY, GROUND)
        self.drone = SealKeeper(KEY, next(self._numbers))
        self._up: list[bytes] = []
        self._down: list[bytes] = []
        self._held: tuple[list[bytes], list[bytes]] = ([], [])
        self._seen_up: list[bytes] = []
        self._seen_down = [YESTERDAY.announcement(DRONE)]
        self.ordered: list[bytes] = []
        self.accepted: list[bytes] = []

    def tick(self) -> None:
        """Half a second passes; both sides send what is due."""
        self.now_s += 0.5
        self._send_down(self.drone.announcement(DRONE))
        for sealed in self.station.signs_of_life():
            self._send_up(sealed)

    def order(self) -> None:
        """Seal an order with a number of its own."""
        number = len(self.ordered).to_bytes(4, "little")
        try:
            sealed = self.station(number, 60_005)
        except LinkError:
            return
        self.ordered.append(number)
        self._send_up(sealed)

    def deliver(self) -> None:
        up, self._up = self._up, []
        down, self._down = self._down, []
        self._arrive(up, down)

    def drop(self) -> None:
        self._up, self._down = [], []

    def delay(self) -> None:
        """Hold back what is on its way, and let go what was held."""
        held, self._held = self._held, (self._up, self._down)
        self._up, self._down = [*held[0]], [*held[1]]

    def replay(self) -> None:
        self._arrive(list(self._seen_up), list(self._seen_down))

    def duplicate(self) -> None:
        self._arrive(list(self._up), list(self._down))

    def forge(self) -> None:
        """Change a bit of everything seen."""
        up = [one[:-1] + bytes((one[-1] ^ 1,)) for one in self._seen_up]
        down = [one[:5] + bytes((one[5] ^ 1,)) + one[6:] for one in self._seen_down]
        self._arrive(up, down)

    def restart(self) -> None:
        """The drone's connection starts again."""
        self.drone = SealKeeper(KEY, next(self._numbers))

    def _send_up(self, sealed: bytes) -> None:
        self._up.append(sealed)
        self._seen_up.append(sealed)

    def _send_down(self, payload: bytes) -> None:
        self._down.append(payload)
        self._seen_down.append(payload)

    def _arrive(self, up: list[bytes], down: list[bytes]) -> None:
        for sealed in up:
            try:
                kind, inside = self.drone.open(sealed, GROUND, DRONE)
            except TunnelError:
                continue
            if kind == ALIVE_INSIDE and alive_of(inside)[0]:
                self._send_down(self.drone.announcement(DRONE, alive_of(inside)[0]))
            elif kind == MOTION_INSIDE:
                self.accepted.append(inside)
        for payload in down:
            try:
                self.station.hear(payload, DRONE)
            except TunnelError:
                continue


STEPS: tuple[Callable[[Link], None], ...] = (
    Link.tick,
    Link.order,
    Link.deliver,
    Link.drop,
    Link.delay,
    Link.replay,
    Link.duplicate,
    Link.forge,
    Link.restart,
)
BEGUN = (Link.tick, Link.deliver, Link.tick, Link.deliver, Link.deliver)


def test_no_order_of_an_attackers_steps_repeats_an_order_or_keeps_the_next_from_arriving() -> (
    None
):
    explored, link = 0, Link()
    follow(lambda: link.now_s)
    for steps in product(STEPS, repeat=DEPTH):
        link = Link()
        for step in (*BEGUN, *steps):
            step(link)
        said = [one.__name__ for one in steps]
        assert len(set(link.accepted)) == len(link.accepted), said
        assert set(link.accepted) <= set(link.ordered), said
        for _ in range(4):  # the attacker goes on to replay; the link carries again
            for step in (Link.tick, Link.deliver, Link.replay, Link.deliver):
                step(link)
        link.order()
        link.deliver()
        assert link.accepted[-1:] == link.ordered[-1:], said
        session, *_ = session_of(link.drone.announcement(DRONE), KEY, DRONE)
        assert link.station._session == session, said
        explored += 1
    assert explored == len(STEPS) ** DEPTH
