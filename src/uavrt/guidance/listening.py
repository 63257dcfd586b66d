"""What was heard and what was not, and where the antenna was then. Pure.

A pulse brings its own pose. That none came is known later, and only for times in which a
detector says that it has searched: a radio that is away is no silence.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, degrees, log10

from uavrt.attitude import rotated
from uavrt.detection.reporting import report_every_s
from uavrt.guidance.search_rules import SEARCH
from uavrt.localization.position.level_belief import Listening
from uavrt.messages import PulsePose, SearchReport, Tag
from uavrt.tangent_plane import TangentPlane
from uavrt.units import wrap_degrees_360


@dataclass(frozen=True, slots=True, kw_only=True)
class Antenna:
    """Where the antenna was."""

    time_s: float
    east_m: float
    north_m: float
    height_m: float
    """Above home."""
    yaw_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A pulse of a tag, or that none was heard when one was due."""

    tag_id: int
    time_s: float
    listening: Listening


@dataclass(slots=True)
class _Ear:
    """Of one tag."""

    slot_s: float
    """Between two pulses, with what they may be off by."""
    late_s: float
    gap_s: float
    """Longest between two reports of one search."""
    threshold_db: float
    """Of what is missed when nothing came so late."""
    least_db: float
    """Of what may come later still."""
    from_s: float | None = None
    """Searched without a gap since then; None: not at all."""
    to_s: float = 0.0
    next_s: float = 0.0
    """Begin of the first slot that is not judged yet."""
    heard_s: list[float] = field(default_factory=list)
    pulses: int = 0
    missed: int = 0


def threshold_db(k: int, *, coded: bool = False) -> float:
    """ENR at which half of the groups of K equal pulses are found; or of K coded bursts.

    A line through `uavrt.detection.sensitivity.enr_needed_db` for tags of 20 ms, of exact and
    of usual intervals: 11.4 dB for one pulse, 7.8 and 8.6 for three, 4.1 and 5.3 for ten. On
    the drone that would take scipy.stats, twice the guide's memory. One coded burst of four
    pulses takes 9.7 dB a pulse, three 6.0, ten 2.7.
    """
    return (9.7 if coded else 11.4) - 6.6 * log10(max(1, k))


class Ears:
    """Turns pulses, reports and places into evidence.

    `k`: pulses of a group; 0: as each tag says.
    `codes`: coded tags that are listed, sought or not: of many, reports come more seldom.
    """

    def __init__(
        self,
        tags: Sequence[Tag],
        plane: TangentPlane,
        *,
        tag_height_m: float,
        k: int = 0,
        codes: int = 0,
    ) -> None:
        self._plane, self._tag_height_m = plane, tag_height_m
        self._ears = {
            tag.tag_id: _coded_ear(tag, codes) if tag.coded else _ear(tag, k or tag.k)
            for tag in tags
        }
        self._places: deque[Antenna] = deque()
        self._keys: dict[tuple[int, int], None] = {}
        self.refused = 0
        """Pulses without information: without a pose, doubtful, ghosts, or repeated."""

    def counts(self, tag_id: int) -> tuple[int, int]:
        """Pulses heard and missed."""
        ear = self._ears[tag_id]
        return ear.pulses, ear.missed

    def place(self, place: Antenna) -> None:
        """Take where the antenna is."""
        self._places.append(place)
        while self._places[0].time_s < place.time_s - SEARCH.kept_s:
            self._places.popleft()

    def pulse(self, pulse_pose: PulsePose, time_s: float) -> Evidence | None:
        """Add a pulse that came at that time; None where it is no evidence."""
        pulse, pose = pulse_pose.pulse, pulse_pose.pose
        ear = self._ears.get(pulse.tag_id)
        if ear is None or pulse.detection_status == "subthreshold":
            return None  # too weak to be heard: its time counts as a miss
        ear.heard_s.append(time_s)  # whatever else is known of it
        doubtful = pulse.also_possible_tag_ids or pulse.ghost_of_tag_id is not None
        if pose is None or doubtful or pulse.key in self._keys:
            self.refused += 1
            return None
        self._keys[pulse.key] = None
        if len(self._keys) > SEARCH.most_keys:
            del self._keys[next(iter(self._keys))]
        ear.pulses += 1
        east, north = self._plane.to_local(pose.latitude_deg, pose.longitude_deg)
        to_north, to_east, _ = rotated(pose.quaternion_wxyz, (1.0, 0.0, 0.0))
        place = Antenna(
            time_s=time_s,
            east_m=float(east),
            north_m=float(north),
            height_m=pose.altitude_relative_m,
            yaw_deg=wrap_degrees_360(degrees(atan2(to_east, to_north))),
        )
        return self._evidence(pulse.tag_id, place, pulse.snr_db, ear)

    def searched(self, report: SearchReport, time_s: float) -> None:
        """Take how far a detector has come with a tag."""
        ear = self._ears.get(report.tag_id)
        if ear is None:
            return
        if ear.from_s is None or time_s - ear.to_s > ear.gap_s:
            ear.from_s = time_s
            ear.next_s = max(ear.next_s, time_s)
        ear.to_s = max(ear.to_s, time_s)

    def missed(self) -> list[Evidence]:
        """What was not heard, as far as that is known by now."""
        found = []
        for tag_id, ear in self._ears.items():
            if ear.from_s is None:
                continue
            while ear.next_s + ear.slot_s + ear.late_s <= ear.to_s:
                begin, ear.next_s = ear.next_s, ear.next_s + ear.slot_s
                # They may come out of turn: a group's weak ones come later.
                ear.heard_s = [one for one in ear.heard_s if one >= begin]
                if any(one < ear.next_s for one in ear.heard_s):
                    continue
                place = self._place_at(begin + 0.5 * ear.slot_s)
                if place is not None:
                    ear.missed += 1
                    found.append(self._evidence(tag_id, place, None, ear))
        return found

    def _place_at(self, time_s: float) -> Antenna | None:
        near = min(self._places, key=lambda one: abs(one.time_s - time_s), default=None)
        return near if near is not None and abs(near.time_s - time_s) < 1.0 else None

    def _evidence(
        self, tag_id: int, place: Antenna, snr_db: float | None, ear: _Ear
    ) -> Evidence:
        weak = snr_db is not None and snr_db < ear.threshold_db
        return Evidence(
            tag_id=tag_id,
            time_s=place.time_s,
            listening=Listening(
                east_m=place.east_m,
                north_m=place.north_m,
                height_m=max(1.0, place.height_m - self._tag_height_m),
                snr_db=snr_db,
                threshold_db=ear.least_db if weak else ear.threshold_db,
                yaw_deg=place.yaw_deg,
            ),
        )


def _ear(tag: Tag, k: int) -> _Ear:
    interval = max(tag.pulse_intervals_s)
    threshold = threshold_db(k)
    return _Ear(
        slot_s=interval + tag.interval_uncertainty_s + 2.0 * tag.interval_jitter_s,
        late_s=(k + SEARCH.late_intervals) * interval + SEARCH.late_s,
        gap_s=SEARCH.report_gap_s,
        threshold_db=threshold,
        least_db=threshold,
    )


def _coded_ear(tag: Tag, codes: int) -> _Ear:
    """Of a coded tag: what no burst shows by itself is missed, and may yet come.

    A burst that stands out is reported within a second or two; what only ten show comes up to
    eighteen intervals late, when the drone is long elsewhere.
    """
    (interval,) = tag.pulse_intervals_s
    return _Ear(
        slot_s=interval + tag.interval_uncertainty_s,
        late_s=interval + SEARCH.late_s,
        gap_s=SEARCH.report_gap_s + report_every_s(codes) - report_every_s(1),
        threshold_db=threshold_db(1, coded=True),
        least_db=threshold_db(tag.k, coded=True),
    )
