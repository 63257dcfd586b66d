"""When a vehicle stood on the ground, by what its autopilot told of arming and landing."""

from collections.abc import Iterable

from uavrt.messages import Health

ARMED, LANDED = "autopilot_armed", "autopilot_landed"
"""Counters of the connection's health."""
EVER_NS = 2**62
"""What was told last holds on."""

Told = Iterable[tuple[int, bool]]
"""Times [ns], and what was told then."""


def spans_on_ground(armed: Told, landed: Told) -> tuple[tuple[int, int], ...]:
    """First and last times [ns] on the ground: disarmed, or landed.

    None where nothing says that it flew, as in a test on a turntable, or where nothing was
    told. What was told holds until it is told anew.

    Parameters
    ----------
    armed, landed : iterable of (int, bool)
        In any order.
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
