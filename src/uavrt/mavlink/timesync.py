"""The autopilot's boot clock on our clock.

TIMESYNC round trips give points (boot time, our time); a straight line through the best of them
gives offset and skew (reference/mavlink.md §4, Time). Pure: no clock is read here.
"""

from collections import deque
from dataclasses import dataclass

from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

MAX_SKEW = 0.02
"""Twice what was measured of a simulated PX4 that fell behind (6 329 ppm); crystals: 1e-4."""
BIN_NS = ns_from_s(2.0)
ONE_WAY_NS = ns_from_s(3.0)
"""How long messages are watched before their least delay is believed."""


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """One answered TIMESYNC request; all times [ns]."""

    remote_ns: int
    local_ns: int
    """Our time half-way between sending and receiving."""
    round_trip_ns: int


class TimeSync:
    """Maps boot time to our time by a line through the shortest round trips of a window.

    A message that waited in a queue waited on one of its two ways only, so its midpoint is
    off by up to half its round trip; the shortest trips waited least. A jump of the boot clock
    that no delay can explain, or its fall, starts the window anew: the autopilot was started
    again.

    Parameters
    ----------
    window_s : float
        How long a round trip counts.
    keep : float
        Share of the shortest round trips of each 2 s that the line is put through: of one a
        second, 30 % in all.
    jump_s : float
        Error beyond half the round trip that means another clock.
    """

    def __init__(
        self, *, window_s: float = 20.0, keep: float = 0.6, jump_s: float = 0.05
    ) -> None:
        self._window_ns = ns_from_s(window_s)
        self._keep = keep
        self._jump_ns = ns_from_s(jump_s)
        self._trips: deque[RoundTrip] = deque()
        self._line: tuple[int, int, float] | None = None  # remote, local, skew
        self._one_way: tuple[int, int, int] | None = None  # first, last local, least offset
        self.resets = 0

    @property
    def synchronized(self) -> bool:
        """True once a round trip is known."""
        return self._line is not None

    @property
    def skew_ppm(self) -> float:
        """How much faster our clock runs than the autopilot's."""
        return 0.0 if self._line is None else self._line[2] * 1e6

    @property
    def round_trip_s(self) -> float | None:
        """Shortest round trip of the window."""
        if not self._trips:
            return None
        return min(trip.round_trip_ns for trip in self._trips) / NANOSECONDS_PER_SECOND

    def reset(self) -> None:
        """Forget everything: the boot clock started again."""
        self._trips.clear()
        self._line = None
        self._one_way = None
        self.resets += 1

    def add_round_trip(self, sent_ns: int, remote_ns: int, received_ns: int) -> None:
        """Take an answered request.

        Parameters
        ----------
        sent_ns, received_ns : int
            Our time when the request left and the answer came [ns].
        remote_ns : int
            Boot time in the answer [ns].
        """
        if received_ns < sent_ns:
            return
        trip = RoundTrip(remote_ns, (sent_ns + received_ns) // 2, received_ns - sent_ns)
        if self._line is not None and self._is_jump(trip):
            self.reset()
        self._trips.append(trip)
        while self._trips[0].local_ns < trip.local_ns - self._window_ns:
            self._trips.popleft()
        self._line = self._fit()

    def add_one_way(self, remote_ns: int, received_ns: int) -> None:
        """Take a message with a boot time, for autopilots that answer no TIMESYNC.

        The least difference ever seen is the offset plus the shortest delay.
        """
        offset = received_ns - remote_ns
        first, _, least = self._one_way or (received_ns, received_ns, offset)
        self._one_way = (first, received_ns, min(least, offset))

    def local_ns(self, remote_ns: int) -> int | None:
        """Our time of a boot time; None while nothing is known.

        Without any round trip the one-way offset serves after 3 s of messages.
        """
        if self._line is not None:
            remote, local, skew = self._line
            delta = remote_ns - remote
            return local + delta + round(delta * skew)
        if self._one_way is not None:
            first, last, least = self._one_way
            if last - first >= ONE_WAY_NS:
                return remote_ns + least
        return None

    def _is_jump(self, trip: RoundTrip) -> bool:
        expected = self.local_ns(trip.remote_ns)
        assert expected is not None
        error = abs(trip.local_ns - expected) - trip.round_trip_ns // 2
        return error > self._jump_ns or trip.remote_ns < self._trips[-1].remote_ns - 10**9

    def _fit(self) -> tuple[int, int, float]:
        """Line through the shortest round trips; of equal ones the newest.

        The shortest of every 2 s, and of these the shorter part, so that they cannot all lie
        together where the link happened to be quiet. While they span less than 4 s the line
        goes through the shortest with the tilt known before, at first none.
        """
        shortest: dict[int, RoundTrip] = {}
        for trip in self._trips:
            place = trip.local_ns // BIN_NS
            rival = shortest.get(place)
            if rival is None or trip.round_trip_ns <= rival.round_trip_ns:
                shortest[place] = trip
        ordered = sorted(shortest.values(), key=lambda t: (t.round_trip_ns, -t.local_ns))
        best = ordered[: max(4, round(self._keep * len(ordered)))]
        base = best[0]
        skew = 0.0 if self._line is None else self._line[2]
        xs = [(trip.remote_ns - base.remote_ns) / NANOSECONDS_PER_SECOND for trip in best]
        if max(xs) - min(xs) < 4.0:
            return base.remote_ns, base.local_ns, skew
        ys = [
            (trip.local_ns - base.local_ns - trip.remote_ns + base.remote_ns)
            / NANOSECONDS_PER_SECOND
            for trip in best
        ]
        mean_x, mean_y = sum(xs) / len(xs), sum(ys) / len(ys)
        spread = sum((x - mean_x) ** 2 for x in xs)
        slope = sum((x - mean_x) * (y - mean_y) for x, y in zip(xs, ys, strict=True))
        skew = max(-MAX_SKEW, min(MAX_SKEW, slope / spread))
        remote = base.remote_ns + round(mean_x * NANOSECONDS_PER_SECOND)
        offset = base.local_ns - base.remote_ns + round(mean_y * NANOSECONDS_PER_SECOND)
        return remote, remote + offset, skew
