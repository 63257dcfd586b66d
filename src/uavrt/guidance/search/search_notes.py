"""Make a search's log entries for the flight's records; no I/O."""

from dataclasses import replace
from typing import Literal

import numpy as np

from uavrt.core.messages import FoundTag, SearchNote, SoughtTag
from uavrt.guidance.operator_orders import VehicleNow
from uavrt.guidance.search.pulse_evidence import PulseEvidence
from uavrt.guidance.search.search_task import SearchTask
from uavrt.planning.beliefs import TagBelief
from uavrt.planning.search import Search

CELLS = 8
"""Number of cells along each side of the area, in the list of the likeliest cells of a tag."""
MOST_CELLS = 6


class SearchNotes:
    """Makes the log entries of one search: its begin, decisions, found tags and end."""

    def __init__(self, task: SearchTask, search: Search, evidence: PulseEvidence) -> None:
        self._task, self._search, self._evidence = task, search, evidence

    def note(
        self,
        event: Literal["begun", "decision", "found", "ended"],
        time_ns: int,
        elapsed_s: float,
        now: VehicleNow,
        text: str,
        reason: str,
        *,
        goal_m: tuple[float, float] | None = None,
        likely: bool = False,
    ) -> SearchNote:
        """Log entry; with `likely`, it lists the likeliest cells of each tag not yet found."""
        return SearchNote(
            time_ns=time_ns,
            order_id=self._task.order.order_id,
            event=event,
            text=text,
            reason=reason,
            elapsed_s=elapsed_s,
            latitude_deg=now.latitude_deg,
            longitude_deg=now.longitude_deg,
            height_m=now.altitude_relative_m,
            battery_percent=now.battery_percent,
            tags=tuple(self._sought(tag.tag_id, likely=likely) for tag in self._task.tags),
            goal=None if goal_m is None else self._task.place(*goal_m),
        )

    def found(self, tag_id: int, time_ns: int, elapsed_s: float, now: VehicleNow) -> SearchNote:
        """Return the log entry on a found tag, with the reason why it counts as found."""
        reason = self._search.found[tag_id].reason
        note = self.note("found", time_ns, elapsed_s, now, f"tag {tag_id} found", reason)
        return replace(note, tag_id=tag_id)

    def all_found(self) -> tuple[FoundTag, ...]:
        """Return positions and accuracies of all found tags, for the other drones."""
        return tuple(
            FoundTag(
                tag_id=tag_id,
                place=self._task.place(one.estimate.east_m, one.estimate.north_m),
                radius95_m=one.estimate.radius95_m,
            )
            for tag_id, one in self._search.found.items()
        )

    def _sought(self, tag_id: int, *, likely: bool) -> SoughtTag:
        belief = self._search.beliefs[tag_id]
        found = self._search.found.get(tag_id)
        estimate = belief.estimate() if found is None else found.estimate
        latitude, longitude = self._task.place(estimate.east_m, estimate.north_m)
        pulses, missed = self._evidence.counts(tag_id)
        return SoughtTag(
            tag_id=tag_id,
            latitude_deg=latitude,
            longitude_deg=longitude,
            radius95_m=estimate.radius95_m,
            existence=belief.existence_probability,
            found_s=None if found is None else found.time_s,
            pulses=pulses,
            missed=missed,
            likely=self._likely(belief) if likely and found is None else (),
        )

    def _likely(self, belief: TagBelief) -> tuple[tuple[float, float, float], ...]:
        """Return the likeliest cells of a tag, as (latitude, longitude, probability)."""
        box = belief.prior.area
        some = belief.hypotheses(4000)
        share, east, north = np.histogram2d(
            some.east_m,
            some.north_m,
            bins=CELLS,
            range=((box.west_m, box.east_m), (box.south_m, box.north_m)),
        )
        share /= len(some.east_m)
        best = np.argsort(share, axis=None)[::-1][:MOST_CELLS]
        squares = []
        for column, row in zip(*np.unravel_index(best, share.shape), strict=True):
            middle = (
                0.5 * (east[column] + east[column + 1]),
                0.5 * (north[row] + north[row + 1]),
            )
            if share[column, row] > 0.0:
                squares.append((*self._task.place(*middle), float(share[column, row])))
        return tuple(squares)
