"""Find the times when a vehicle stood on the ground, from reports of arming and landing."""

from collections.abc import Iterable

from uavrt.core.messages import Health

ARMED, LANDED = "autopilot_armed", "autopilot_landed"
"""Names of the counters in health reports for the autopilot's armed and landed states."""
GROUND_STATION = "ground station"
"""Process name in the ground station's own health reports."""
EVER_NS = 2**62
"""Time that marks the end of a stay on the ground if no later report ends it [ns]."""

Reports = Iterable[tuple[int, bool]]
"""Pairs of a report's time [ns] and a state, armed or landed: True or False."""


def spans_on_ground(armed: Reports, landed: Reports) -> tuple[tuple[int, int], ...]:
    """Start and end of each time span in which a vehicle was disarmed or landed [ns].

    A reported state is valid until the next report. The result is empty if no report shows that
    the vehicle flies, as in a test on a turntable.
    """
    reports = [(time, "armed", state) for time, state in armed]
    reports += [(time, "landed", state) for time, state in landed]
    now: dict[str, bool] = {}
    flew, since = False, None
    found = []
    for time, what, state in sorted(reports):
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


def ground_state(health: Health) -> tuple[float | None, float | None]:
    """Armed and landed states in a health report; None for a state that is not reported.

    The report contains 1 for yes and 0 for no.
    """
    return health.counters.get(ARMED), health.counters.get(LANDED)


class GroundStates:
    """Records the changes of an autopilot's armed and landed states."""

    def __init__(self) -> None:
        self._reports: list[tuple[int, bool | None, bool | None]] = []

    def add(self, time_ns: int, armed: float | None, landed: float | None) -> bool:
        """Add a report of both states; return True if one of them has changed.

        A state is None if it is not reported.
        """
        now = (None if armed is None else bool(armed), None if landed is None else bool(landed))
        last = self._reports[-1][1:] if self._reports else (None, None)
        if now == last:
            return False
        self._reports.append((time_ns, *now))
        return True

    def spans(self) -> tuple[tuple[int, int], ...]:
        """Start and end of each time span on the ground [ns], as in `spans_on_ground`."""
        return spans_on_ground(
            [(time_ns, armed) for time_ns, armed, _ in self._reports if armed is not None],
            [(time_ns, landed) for time_ns, _, landed in self._reports if landed is not None],
        )
