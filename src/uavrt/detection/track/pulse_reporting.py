"""Create records of pulses: find the track that is the tag's, and report each pulse once."""

import math

from uavrt.core.messages import DetectionStatus, Pulse, SearchReport, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, db_from_power, ns_from_s
from uavrt.detection.search.refine import Measured
from uavrt.detection.search.thresholds import decision_interval_s
from uavrt.detection.signal.frequency_circle import apart_hz, in_channel_hz
from uavrt.detection.signal.occupancy import Occupancy
from uavrt.detection.signal.sample_buffer import Counters
from uavrt.detection.signal.tuning import CHANNEL
from uavrt.detection.track.chance import log_doubt
from uavrt.detection.track.search_band import SearchBand
from uavrt.detection.track.tracks import Slot, Track
from uavrt.detection.track.tuning import BOUNDS, RATES

_REPORT_EVERY_NS = NANOSECONDS_PER_SECOND


class Reporter:
    """Creates the pulse records and search reports of one detector."""

    def __init__(
        self, tag: Tag, *, center_frequency_hz: float, sample_rate_hz: float, counters: Counters
    ) -> None:
        self._tag = tag
        self._center_hz = center_frequency_hz
        self._sample_rate_hz = sample_rate_hz
        self._patience_s = RATES.patience_intervals * max(tag.pulse_intervals_s)
        self._counters = counters
        self._doubt = log_doubt(tag.false_alarm_probability, decision_interval_s(tag))
        self._pulses: list[Pulse] = []
        self._reports: list[SearchReport] = []
        self._sequence = dict.fromkeys(range(1, len(tag.pulse_intervals_s) + 1), 0)
        self._last_times: list[int] = []
        self._given: list[tuple[int, int | None, int]] = []
        """Rate, group and number within the group of each recently reported pulse."""
        self._reported_ns: int | None = None

    def drain(self) -> list[Pulse]:
        """Return the pulses found since the last call."""
        pulses, self._pulses = self._pulses, []
        return pulses

    def drain_reports(self) -> list[SearchReport]:
        """Return the search reports since the last call."""
        reports, self._reports = self._reports, []
        return reports

    def owner(self, tracks: list[Track], nominal_hz: float, now_s: float) -> Track | None:
        """Find the track that is the tag's: the active one nearest to its nominal frequency.

        The strength does not matter. Among tracks of nearly equal frequency, the one that
        received a pulse last is chosen.
        """
        alive = [
            t
            for t in tracks
            if t.confirmed
            and not t.dead
            and t.ghost_of is None
            and now_s - t.last_accepted_s < BOUNDS.active_intervals * t.interval_s
        ]
        if not alive:
            return None
        rate_hz = self._sample_rate_hz
        misses = [abs(apart_hz(t.offset_hz, nominal_hz, rate_hz)) for t in alive]
        most = min(misses) + BOUNDS.same_transmitter_hz
        close = [t for t, miss in zip(alive, misses, strict=True) if miss < most]
        return max(close, key=lambda t: (not t.held, t.last_accepted_s))

    def settle(self, tracks: list[Track], nominal_hz: float, now_s: float) -> None:
        """Find the track that is the tag's, and report its pulses."""
        owner = self.owner(tracks, nominal_hz, now_s)
        for track in tracks:
            if owner is not None:
                track.held = track is not owner
            if not track.held:
                self.report(track)

    def report(self, track: Track, *, last: bool = False) -> None:
        """Create records of a track's accepted pulses; weak pulses become unconfirmed ones."""
        if self.doubts(track, last=last) or track.held:
            return
        oldest_open = track.number - self._tag.k + 1
        for slot in track.slots:
            if slot.state == "accepted":
                certain = slot.time_s <= track.certain_s
                if not (certain or last or track.time_s - slot.time_s > self._patience_s):
                    continue
                slot.state = "reported"
                sure = track.confirmed and certain and not slot.disputed
                sure = sure and track.ghost_of is None
                self._record(track, slot, "confirmed" if sure else "detected")
            elif slot.state == "open" and track.confirmed and slot.number < oldest_open:
                if slot.measured.power > 4.0:
                    slot.state = "reported"
                    self._record(track, slot, "subthreshold")
                else:
                    slot.state = "missed"

    def doubts(self, track: Track, *, last: bool = False) -> bool:
        """True if chance bursts form such tracks more often than the false-alarm rate allows.

        The pulses of a doubtful track are reported only when the track is confirmed.
        """
        if track.confirmed:
            return False
        doubtful = track.odds < self._doubt
        waiting = track.in_doubt and not (track.dead or last)
        track.in_doubt |= doubtful
        return doubtful or waiting

    def searched(
        self, time_ns: int, band: SearchBand, occupancy: Occupancy | None = None
    ) -> None:
        """Record what a band has searched, and create a search report about once a second."""
        if self._reported_ns is None:
            self._reported_ns = time_ns
        if time_ns - self._reported_ns < _REPORT_EVERY_NS:
            return
        self._reported_ns = time_ns
        noise = band.noise_now
        self._reports.append(
            SearchReport(
                tag_id=self._tag.tag_id,
                time_ns=time_ns,
                frequency_hz=self._tag.frequency_hz,
                noise_psd=float(noise[len(noise) // 2]) / self._sample_rate_hz,
                best_score=band.score(),
                usable_share=None if occupancy is None else occupancy.take_share(),
                weakest_enr_db=band.weakest_enr_db(),
            )
        )
        del self._reports[:-3600]

    def _place(self, track: Track) -> None:
        """Choose a track's frequency among its aliases, and again when it crosses an edge."""
        place_hz = in_channel_hz(
            track.steady_hz,
            nominal_hz=self._tag.frequency_hz - self._center_hz,
            sample_rate_hz=self._sample_rate_hz,
            margin_hz=CHANNEL.edge_hz if track.placed else 0.0,
        )
        track.placed = True
        # All later measurements are near this frequency.
        track.offset_hz += place_hz - track.steady_hz
        track.steady_hz = place_hz

    def _record(self, track: Track, slot: Slot, status: DetectionStatus) -> None:
        tag = self._tag
        width_ns = ns_from_s(tag.pulse_width_s)
        if any(abs(slot.time_ns - t) < width_ns for t in self._last_times):
            return
        self._last_times.append(slot.time_ns)
        del self._last_times[:-64]
        group = slot.number // tag.k
        index = slot.number % tag.k + 1
        known = (track.rate, track.sequences.get(group), index)
        # Without a lock two pulses may have the same lattice number, one of them a neighbour's:
        # the later pulse begins a group.
        if known[1] is None or known in self._given:
            self._sequence[track.rate] += 1
            track.sequences[group] = self._sequence[track.rate]
            for old in [g for g in track.sequences if g < group - 8]:
                del track.sequences[old]
            self._counters.groups += 1
        self._given.append((track.rate, track.sequences[group], index))
        del self._given[:-64]
        members = [s.measured.enr for s in track.received if s.number // tag.k == group]
        next_s, half_s = track.expected()
        ahead = ns_from_s(next_s - track.time_s)
        center = slot.time_ns + ahead
        half_ns = ns_from_s(half_s)
        rate_hz = self._sample_rate_hz
        self._place(track)
        beside_hz = apart_hz(slot.measured.offset_hz, track.steady_hz, rate_hz)
        self._counters.pulses += 1
        self._pulses.append(
            Pulse(
                tag_id=tag.tag_id,
                frequency_hz=self._center_hz + track.steady_hz + beside_hz,
                start_time_ns=slot.time_ns,
                end_time_ns=slot.time_ns + width_ns,
                snr_db=snr_db(slot.measured),
                group_snr_db=db_from_power(sum(members) / max(1, len(members))),
                score=track.score,
                group_index=index,
                group_sequence=track.sequences[group],
                noise_psd=slot.measured.noise / self._sample_rate_hz,
                detection_status=status,
                confirmed=status == "confirmed",
                rate=track.rate,
                predicted_next_start_ns=center - half_ns,
                predicted_next_end_ns=center + half_ns + width_ns,
                also_possible_tag_ids=track.alternatives,
                ghost_of_tag_id=track.ghost_of,
            )
        )


def snr_db(pulse: Measured) -> float:
    """Energy of a pulse over the noise power density (ENR) [dB]."""
    return 10.0 * math.log10(pulse.enr)
