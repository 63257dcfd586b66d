"""When a vehicle stood on the ground, by what its autopilot told of arming and landing."""

from collections.abc import Iterable

from uavrt.messages import Health

ARMED, LANDED = "autopilot_armed", "autopilot_landed"
"""Counters of the health of the drone's connection, and of the ground station's."""
GROUND_STATION = "ground station"
"""Process that a ground station writes its own health as."""
EVER_NS = 2**62
"""What was told last holds on."""

Told = Iterable[tuple[int, bool]]
"""Times [ns], and what was told then."""


def spans_on_ground(armed: Told, landed: Told) -> tuple[tuple[int, int], ...]:
    """First and last times [ns] on the ground: disarmed, or landed.

    None where nothing says that it flew, as in a test on a turntable, or where nothing was
    told. What was told holds until it is told anew.

    `armed`, `landed`: in any order.
    """
    told = [(time, "armed", state) for time, state in armed]
    told += [(time, "landed", state) for time, state in landed]
    now: dict[str, bool] = {}
    flew, since = False, None
    found = []
    for time, what, state in sorted(told):
        now[what] = state
        if not now.get("armed", True) or now.get("landed", False):
            since = time if since is None else since
            continue
        flew = True
        if since is not None and since < time:
            found.append((since, time - 1))
        since = None
    if since is not None:
        found.append((since, EVER_NS))
    return tuple(found) if flew else ()


def told_of_ground(health: Health) -> tuple[float | None, float | None]:
    """What a sign of life says of arming and landing; None where it says nothing."""
    return health.counters.get(ARMED), health.counters.get(LANDED)


class ToldStates:
    """What an autopilot told of arming and landing, as it comes; only changes are kept."""

    def __init__(self) -> None:
        self._told: list[tuple[int, bool | None, bool | None]] = []

    def add(self, time_ns: int, armed: float | None, landed: float | None) -> bool:
        """Add what was told at a time; False where it is what was told before.

        `armed`, `landed`: 0 for no; None where it was not reported.
        """
        now = (None if armed is None else bool(armed), None if landed is None else bool(landed))
        last = self._told[-1][1:] if self._told else (None, None)
        if now == last:
            return False
        self._told.append((time_ns, *now))
        return True

    def spans(self) -> tuple[tuple[int, int], ...]:
        """First and last times [ns] on the ground, as `spans_on_ground` has it."""
        return spans_on_ground(
            [(time_ns, armed) for time_ns, armed, _ in self._told if armed is not None],
            [(time_ns, landed) for time_ns, _, landed in self._told if landed is not None],
        )
