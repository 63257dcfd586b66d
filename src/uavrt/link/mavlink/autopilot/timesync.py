"""Convert the autopilot's time since boot to this computer's time.

A TIMESYNC round trip gives one pair of boot time and local time. A straight line through the
pairs with the shortest round trips gives clock offset and rate. If the autopilot does not
answer TIMESYNC, the time stamps of its messages limit the offset from one side, because no
message arrives before it was sent. This module reads no clock itself.
"""

import math
from collections import deque
from dataclasses import dataclass

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s

MAX_SKEW = 0.025
"""Maximum relative rate error of the autopilot's clock; simulated PX4 1.17: 1.1 to 2 % slow."""
BIN_NS = ns_from_s(2.0)
LEAST_SPAN_S = 4.0
"""Shortest span of TIMESYNC round trips that gives a reliable clock rate [s]."""
CLEAR_SPAN_S = 0.5
WINDOW_NS = ns_from_s(20.0)
"""Age up to which a TIMESYNC round trip is used for the clock fit [ns]."""
KEPT_SHARE = 0.6
"""Share of the TIMESYNC round trips that the clock fit uses, shortest first. The shortest of
every 2 s are selected beforehand."""
JUMP_NS = ns_from_s(0.08)
"""Clock error that shows a restarted autopilot, in excess of the uncertainty of round trips and
clock rate [ns]. An error below one second must occur in two consecutive answers."""
CLEAR_SKEW = 0.002
"""Largest uncertainty of a clock rate error that was fitted over less than `LEAST_SPAN_S` and
is still used [s/s]."""
ONE_WAY_NS = ns_from_s(3.0)
"""Time for which message delays are collected before the smallest one sets the clock offset
[ns]."""
ONE_WAY_BIN_NS = ns_from_s(1.0)
ONE_WAY_BINS = 20
"""Number of one-second bins of message delays that determine the clock offset. Older delays are
dropped because the clock has drifted since."""
STALE_NS = ns_from_s(10.0)
"""Age of the last TIMESYNC answer above which the clock fit counts as extrapolated [ns]."""


@dataclass(frozen=True, slots=True)
class RoundTrip:
    """Send, answer and receive times of one answered TIMESYNC request [ns]."""

    remote_ns: int
    local_ns: int
    """Local time midway between sending and receiving [ns]."""
    round_trip_ns: int


class TimeSync:
    """Converts the autopilot's boot time to local time by a line through the shortest round
    trips.

    Usually a message waits in a queue in one direction only, so the midpoint of a round trip is
    wrong by up to half its duration. The shortest round trips waited least. The fit starts
    again if the boot time decreases, or jumps by more than any delay explains: the autopilot
    has restarted.
    """

    def __init__(self) -> None:
        self._trips: deque[RoundTrip] = deque()
        self._line: tuple[int, int, float] | None = None  # remote, local, skew
        self._skew = 0.0
        """Clock skew fitted last, a fraction; kept over an autopilot reboot (same crystal)."""
        self._tilted = False
        """True if the clock skew in `_line` was fitted to its answers, False if assumed."""
        self._uncertain_ns = 0
        """Uncertainty of the clock offset: half the median round trip of answers used [ns]."""
        self._suspect: RoundTrip | None = None
        """TIMESYNC answer that only a new boot clock explains; the next clear one decides."""
        self._one_way: deque[tuple[int, int]] = deque(maxlen=ONE_WAY_BINS)
        """Arrival time and clock offset [ns] of each second's message with the least delay."""
        self._one_way_bin_ns = 0
        self.round_trips = 0
        """Number of answered TIMESYNC requests since the start."""
        self.residual_s: float | None = None
        """Rms error of the line fitted to boot and local times of TIMESYNC answers [s]."""
        self.resets = 0

    @property
    def synchronized(self) -> bool:
        """True once at least one TIMESYNC round trip has been measured."""
        return self._line is not None

    @property
    def skew_ppm(self) -> float:
        """Relative rate error between the local clock and the autopilot's clock [ppm]."""
        return 0.0 if self._line is None else self._line[2] * 1e6

    @property
    def round_trip_s(self) -> float | None:
        """Shortest round trip of the window [s]."""
        if not self._trips:
            return None
        return min(trip.round_trip_ns for trip in self._trips) / NANOSECONDS_PER_SECOND

    def reset(self) -> None:
        """Discard all measurements except the clock rate, which a restarted autopilot keeps."""
        self._trips.clear()
        self._line = self._suspect = None
        self._one_way.clear()
        self.residual_s = None
        self.resets += 1

    def age_ns(self, now_ns: int) -> int | None:
        """Time since the last TIMESYNC answer [ns]; None if there has been none."""
        return now_ns - self._trips[-1].local_ns if self._trips else None

    def is_stale(self, now_ns: int) -> bool:
        """True if the clock conversion is extrapolated or rests on one-way delays only, because
        TIMESYNC answers are missing.
        """
        age_ns = self.age_ns(now_ns)
        return age_ns is None or age_ns > STALE_NS

    def counters(self, now_ns: int) -> dict[str, float]:
        """Clock offset, rate and round trip for a health record, without unknown values."""
        age_ns, trip_s, residual_s = self.age_ns(now_ns), self.round_trip_s, self.residual_s
        known = {
            "clock_skew_ppm": self.skew_ppm if self.synchronized else None,
            "clock_residual_ms": None if residual_s is None else 1e3 * residual_s,
            "clock_round_trip_ms": None if trip_s is None else 1e3 * trip_s,
            "clock_answer_age_s": None if age_ns is None else age_ns / NANOSECONDS_PER_SECOND,
        }
        return {
            "clock_answers": float(self.round_trips),
            "clock_resets": float(self.resets),
            **{name: round(value, 3) for name, value in known.items() if value is not None},
        }

    def add_round_trip(self, sent_ns: int, remote_ns: int, received_ns: int) -> None:
        """Add an answered TIMESYNC request [ns]: local times of request and answer, and the
        autopilot's boot time in the answer.
        """
        if received_ns < sent_ns:
            return
        trip = RoundTrip(remote_ns, (sent_ns + received_ns) // 2, received_ns - sent_ns)
        suspect = self._suspect
        if self._line is not None and self._is_jump(trip):
            far = abs(self._error_ns(trip)) > NANOSECONDS_PER_SECOND
            if suspect is None and not far:
                self._suspect = trip
                return
            self.reset()
        if self._line is not None:
            surely_ns = abs(self._error_ns(trip)) + trip.round_trip_ns // 2
            self._suspect = None if surely_ns < JUMP_NS else self._suspect
        self._trips.append(trip)
        self.round_trips += 1
        while self._trips[0].local_ns < trip.local_ns - WINDOW_NS:
            self._trips.popleft()
        self._line = self._fit()

    def add_one_way(self, remote_ns: int, received_ns: int) -> None:
        """Use the time stamp of a message if the autopilot does not answer TIMESYNC.

        The smallest differences between arrival and boot time in the last seconds are the clock
        offset plus the shortest delay.
        """
        offset = received_ns - remote_ns
        if not self._one_way or received_ns - self._one_way_bin_ns >= ONE_WAY_BIN_NS:
            self._one_way_bin_ns = received_ns
            self._one_way.append((received_ns, offset))
        elif offset < self._one_way[-1][1]:
            self._one_way[-1] = (received_ns, offset)

    def local_ns(self, remote_ns: int) -> int | None:
        """Local time at which the boot clock shows a given time [ns].

        Without round trips it is computed from one-way delays, once these span 3 s; until then
        it is None.
        """
        if self._line is not None:
            remote, local, skew = self._line
            delta = remote_ns - remote
            return local + delta + round(delta * skew)
        bound = self._one_way
        if not bound or bound[-1][0] - bound[0][0] < ONE_WAY_NS:
            return None
        return remote_ns + self._least_offset(remote_ns + bound[-1][1])

    def _least_offset(self, at_ns: int) -> int:
        """Estimate the clock offset at a local time from one-way message delays [ns].

        The result is a line below all measured offsets. Its slope follows from the messages
        with the smallest delays in the first and second half of the window.
        """
        points = list(self._one_way)
        half = len(points) // 2
        early = min(points[:half], key=lambda point: point[1])
        late = min(points[half:], key=lambda point: point[1])
        lean = 0.0
        if late[0] - early[0] >= ONE_WAY_BIN_NS:
            lean = max(-MAX_SKEW, min(MAX_SKEW, (late[1] - early[1]) / (late[0] - early[0])))
        least = min(offset - round(lean * (when - at_ns)) for when, offset in points)
        return int(least)

    def _error_ns(self, trip: RoundTrip) -> int:
        """Difference between a round trip's local time and the clock fit's prediction [ns]."""
        expected = self.local_ns(trip.remote_ns)
        assert expected is not None
        return trip.local_ns - expected

    def _is_jump(self, trip: RoundTrip) -> bool:
        assert self._line is not None
        allowed = trip.round_trip_ns // 2 + self._uncertain_ns + JUMP_NS
        if not self._tilted:
            allowed += round(MAX_SKEW * abs(trip.remote_ns - self._line[0]))
        fell = trip.remote_ns < self._trips[-1].remote_ns - NANOSECONDS_PER_SECOND
        return abs(self._error_ns(trip)) > allowed or fell

    def _fit(self) -> tuple[int, int, float]:
        """Fit a line from boot time to local time through the shortest round trips.

        The shortest round trip of every 2 s (less at the start) is selected, then the shortest
        of these, so that the selection spreads over the window. Of equally short round trips
        the newest is selected. While the time span is too short for a clock rate, the line goes
        through the shortest round trip with the previous rate, which is 0 at the start.
        """
        shortest: dict[int, RoundTrip] = {}
        span_ns = self._trips[-1].local_ns - self._trips[0].local_ns
        piece_ns = min(BIN_NS, span_ns // 6 + 1)
        for trip in self._trips:
            place = trip.local_ns // piece_ns
            rival = shortest.get(place)
            if rival is None or trip.round_trip_ns <= rival.round_trip_ns:
                shortest[place] = trip
        ordered = sorted(shortest.values(), key=lambda t: (t.round_trip_ns, -t.local_ns))
        best = ordered[: max(4, round(KEPT_SHARE * len(ordered)))]
        base = best[0]
        xs = [(trip.remote_ns - base.remote_ns) / NANOSECONDS_PER_SECOND for trip in best]
        span_s = max(xs) - min(xs)
        uncertain_s = best[-1].round_trip_ns / NANOSECONDS_PER_SECOND / 2.0
        clear = span_s > CLEAR_SPAN_S and uncertain_s < CLEAR_SKEW * span_s
        self._tilted = clear or span_s >= LEAST_SPAN_S
        self._uncertain_ns = best[len(best) // 2 if self._tilted else 0].round_trip_ns // 2
        if not self._tilted:
            return base.remote_ns, base.local_ns, self._skew
        ys = [
            (trip.local_ns - base.local_ns - trip.remote_ns + base.remote_ns)
            / NANOSECONDS_PER_SECOND
            for trip in best
        ]
        mean_x, mean_y = sum(xs) / len(xs), sum(ys) / len(ys)
        spread = sum((x - mean_x) ** 2 for x in xs)
        slope = sum((x - mean_x) * (y - mean_y) for x, y in zip(xs, ys, strict=True))
        skew = self._skew = max(-MAX_SKEW, min(MAX_SKEW, slope / spread))
        errors = [y - mean_y - skew * (x - mean_x) for x, y in zip(xs, ys, strict=True)]
        self.residual_s = math.sqrt(sum(error**2 for error in errors) / len(errors))
        remote = base.remote_ns + ns_from_s(mean_x)
        offset = base.local_ns - base.remote_ns + ns_from_s(mean_y)
        return remote, remote + offset, skew
