"""Convert detected and missed pulses to evidence on where tags are; no I/O.

A detected pulse contains the antenna's pose. A missed pulse is found later, and only at times
that a detector reports as searched. So without a working radio, no pulse counts as missed.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, degrees, isfinite, log10

from uavrt.core.earth.attitude import rotated
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import PulsePose, SearchReport, Tag
from uavrt.core.units import wrap_degrees_360
from uavrt.detection.reporting import report_every_s
from uavrt.guidance.search_rules import SEARCH_RULES
from uavrt.localization.position.levels.level_belief import Listening


@dataclass(frozen=True, slots=True, kw_only=True)
class Antenna:
    """Position and heading of the antenna at one time."""

    time_s: float
    east_m: float
    north_m: float
    height_m: float
    """Height of the antenna above home [m]."""
    yaw_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """A detected or missed pulse: antenna pose, and its SNR or the detection threshold."""

    tag_id: int
    time_s: float
    listening: Listening


@dataclass(slots=True)
class _TagSearch:
    """Search of one tag: times searched, thresholds, noise, and numbers of pulses."""

    slot_s: float
    """Length of a time slot that must contain a pulse [s]: pulse interval plus its
    uncertainty."""
    late_s: float
    gap_s: float
    """Largest time between two search reports without an interruption of the search [s]."""
    threshold_db: float
    """Detection threshold for missed pulses, and for received ones above it [dB, ratio of pulse
    energy to noise density]."""
    least_db: float
    """Detection threshold for received pulses below `threshold_db` [dB, ratio of pulse energy
    to noise density]."""
    from_s: float | None = None
    """Start of the uninterrupted search in progress [s]; None if the tag was not searched."""
    to_s: float = 0.0
    next_s: float = 0.0
    """Start of the first time slot that is not yet evaluated [s]."""
    first_psds: dict[str, float] = field(default_factory=dict)
    noise_db: float = 0.0
    """Latest noise power density, relative to the first measured value [dB]."""
    heard_s: list[float] = field(default_factory=list)
    pulses: int = 0
    missed: int = 0

    def set_noise(self, measured_by: str, psd: float) -> None:
        """Update `noise_db` from a noise power density `psd`.

        Unlike a pulse's energy, noise may change with the heading.

        Reports measure the noise of a channel, pulses that at one frequency. So each kind
        (`measured_by`) has its own first value.
        """
        if isfinite(psd) and psd > 0.0:
            before = 10.0 ** (self.noise_db / 10.0)
            first = self.first_psds.setdefault(measured_by, psd / before)
            self.noise_db = 10.0 * log10(psd / first)


def threshold_db(k: int, *, coded: bool = False) -> float:
    """Return the detection threshold of K pulses, or coded bursts, searched together [dB].

    The threshold is the ratio of one pulse's energy to the noise density at which half of such
    groups are found. It is fitted to `uavrt.detection.sensitivity.enr_needed_db` for 20 ms tags
    with exact and usual intervals: 11.4 dB for one pulse, 7.8 and 8.6 for three, 4.1 and 5.3
    for ten. That function would need scipy.stats, twice the guide's memory. One coded burst of
    four pulses takes 9.7 dB per pulse, three 6.0, ten 2.7.
    """
    return (9.7 if coded else 11.4) - 6.6 * log10(max(1, k))


class PulseEvidence:
    """Converts pulses, search reports and antenna poses to evidence on tag positions."""

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
        self._searches = {
            tag.tag_id: _coded_search(tag, codes)
            if tag.coded
            else _pulse_search(tag, k or tag.k)
            for tag in tags
        }
        self._places: deque[Antenna] = deque()
        self._keys: dict[tuple[int, int], None] = {}
        self.refused = 0
        """Number of unused pulses: without pose, doubtful, repeated, or a receiver artefact."""

    def counts(self, tag_id: int) -> tuple[int, int]:
        """Return how many pulses of a tag were detected, and how many were missed."""
        search = self._searches[tag_id]
        return search.pulses, search.missed

    def place(self, place: Antenna) -> None:
        """Store the antenna's present pose; missed pulses at this time will use it."""
        self._places.append(place)
        while self._places[0].time_s < place.time_s - SEARCH_RULES.kept_s:
            self._places.popleft()

    def pulse(self, pulse_pose: PulsePose, time_s: float) -> Evidence | None:
        """Add a pulse received at `time_s`; return its evidence, None if it cannot be used."""
        pulse, pose = pulse_pose.pulse, pulse_pose.pose
        search = self._searches.get(pulse.tag_id)
        if search is None or pulse.detection_status == "subthreshold":
            return None  # too weak to be heard: its time counts as a miss
        search.heard_s.append(time_s)  # whatever else is known of it
        doubtful = pulse.also_possible_tag_ids or pulse.ghost_of_tag_id is not None
        if pose is None or doubtful or pulse.key in self._keys:
            self.refused += 1
            return None
        self._keys[pulse.key] = None
        if len(self._keys) > SEARCH_RULES.most_keys:
            del self._keys[next(iter(self._keys))]
        search.pulses += 1
        search.set_noise("pulse", pulse.noise_psd)
        east, north = self._plane.to_local(pose.latitude_deg, pose.longitude_deg)
        to_north, to_east, _ = rotated(pose.quaternion_wxyz, (1.0, 0.0, 0.0))
        place = Antenna(
            time_s=time_s,
            east_m=float(east),
            north_m=float(north),
            height_m=pose.altitude_relative_m,
            yaw_deg=wrap_degrees_360(degrees(atan2(to_east, to_north))),
        )
        return self._evidence(pulse.tag_id, place, pulse.snr_db, search)

    def searched(self, report: SearchReport, time_s: float) -> None:
        """Note a detector's report that it has searched for a tag until `time_s`."""
        search = self._searches.get(report.tag_id)
        if search is None:
            return
        if search.from_s is None or time_s - search.to_s > search.gap_s:
            search.first_psds.clear()  # the radio was reopened, perhaps with another gain
            search.from_s = time_s
            search.next_s = max(search.next_s, time_s)
        search.to_s = max(search.to_s, time_s)
        search.set_noise("report", report.noise_psd)

    def missed(self) -> list[Evidence]:
        """Return evidence of pulses that were expected, but not reported in time."""
        found = []
        for tag_id, search in self._searches.items():
            if search.from_s is None:
                continue
            while search.next_s + search.slot_s + search.late_s <= search.to_s:
                begin, search.next_s = search.next_s, search.next_s + search.slot_s
                # They may come out of turn: a group's weak ones come later.
                search.heard_s = [one for one in search.heard_s if one >= begin]
                if any(one < search.next_s for one in search.heard_s):
                    continue
                place = self._place_at(begin + 0.5 * search.slot_s)
                if place is not None:
                    search.missed += 1
                    found.append(self._evidence(tag_id, place, None, search))
        return found

    def _place_at(self, time_s: float) -> Antenna | None:
        near = min(self._places, key=lambda one: abs(one.time_s - time_s), default=None)
        return near if near is not None and abs(near.time_s - time_s) < 1.0 else None

    def _evidence(
        self, tag_id: int, place: Antenna, snr_db: float | None, search: _TagSearch
    ) -> Evidence:
        weak = snr_db is not None and snr_db < search.threshold_db
        return Evidence(
            tag_id=tag_id,
            time_s=place.time_s,
            listening=Listening(
                east_m=place.east_m,
                north_m=place.north_m,
                height_m=max(1.0, place.height_m - self._tag_height_m),
                snr_db=None if snr_db is None else snr_db + search.noise_db,
                threshold_db=search.noise_db
                + (search.least_db if weak else search.threshold_db),
                yaw_deg=place.yaw_deg,
            ),
        )


def _pulse_search(tag: Tag, k: int) -> _TagSearch:
    interval = max(tag.pulse_intervals_s)
    threshold = threshold_db(k)
    return _TagSearch(
        slot_s=interval + tag.interval_uncertainty_s + 2.0 * tag.interval_jitter_s,
        late_s=(k + SEARCH_RULES.late_intervals) * interval + SEARCH_RULES.late_s,
        gap_s=SEARCH_RULES.report_gap_s,
        threshold_db=threshold,
        least_db=threshold,
    )


def _coded_search(tag: Tag, codes: int) -> _TagSearch:
    """Return the initial search state of a coded tag.

    Strong bursts are reported within two seconds. Weak bursts that are found only as a group
    come later, up to 18 intervals in a group of ten, so they do not delay the count of missed
    ones.
    """
    (interval,) = tag.pulse_intervals_s
    return _TagSearch(
        slot_s=interval + tag.interval_uncertainty_s,
        late_s=interval + SEARCH_RULES.late_s,
        gap_s=SEARCH_RULES.report_gap_s + report_every_s(codes) - report_every_s(1),
        threshold_db=threshold_db(1, coded=True),
        least_db=threshold_db(tag.k, coded=True),
    )
