"""Predict the next burst of a coded tag that has been identified."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from uavrt.core.messages import Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.coded.tuning import IDENTITY


@dataclass(slots=True)
class BurstTrack:
    """Prediction of the bursts of an identified tag; `row`: frequency row of its cells."""

    tag: Tag
    time_ns: int
    row: int
    interval_s: float
    error_s: float

    def add(self, time_ns: int, row: int) -> None:
        """Update the prediction with a burst later than the newest."""
        passed_s = (time_ns - self.time_ns) / NANOSECONDS_PER_SECOND
        count = round(passed_s / self.interval_s)
        if count >= 1:
            measured_s, error_s = passed_s / count, 2.0 * IDENTITY.timing_s / count
            nominal_s, most_s = self.tag.pulse_intervals_s[0], self.tag.interval_uncertainty_s
            if abs(measured_s - nominal_s) <= most_s + error_s and error_s < self.error_s:
                self.interval_s = measured_s
                self.error_s = error_s + IDENTITY.own_error * measured_s
        self.time_ns, self.row = time_ns, row

    def expected(self, upto_ns: int) -> Iterator[tuple[int, float]]:
        """Expected starts of bursts before a time [ns], and their uncertainties [s]."""
        for count in range(1, IDENTITY.most_missed + 1):
            at_ns = self.time_ns + round(count * self.interval_s * NANOSECONDS_PER_SECOND)
            if at_ns >= upto_ns:
                return
            yield at_ns, IDENTITY.timing_s + count * self.error_s


class Tracks:
    """Predictions of all identified tags of a channel."""

    def __init__(self, tags: Sequence[Tag]) -> None:
        self.tags = {tag.tag_id: tag for tag in tags}
        self.alive: dict[int, BurstTrack] = {}

    def add(self, tag_id: int, time_ns: int, row: int) -> BurstTrack:
        """Add a burst of a tag; return its prediction."""
        track = self.alive.get(tag_id)
        if track is None:
            tag = self.tags[tag_id]
            track = BurstTrack(
                tag=tag,
                time_ns=time_ns,
                row=row,
                interval_s=tag.pulse_intervals_s[0],
                error_s=tag.interval_uncertainty_s,
            )
            self.alive[tag_id] = track
        elif time_ns > track.time_ns:
            track.add(time_ns, row)
        return track

    def drop_silent(self, now_ns: int) -> None:
        """Drop the predictions of tags that have sent no burst for too long."""
        self.alive = {
            tag_id: track
            for tag_id, track in self.alive.items()
            if now_ns - track.time_ns
            <= (IDENTITY.most_missed + 1) * track.interval_s * NANOSECONDS_PER_SECOND
        }
