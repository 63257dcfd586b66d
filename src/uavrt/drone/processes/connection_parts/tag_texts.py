"""Texts for the operator when a tag is first received in a flight, or received again."""

from collections.abc import Iterable, Mapping

from uavrt.core.messages import Pulse, Tag
from uavrt.core.units import s_from_ns

SILENCE_S = 30.0
SILENCE_INTERVALS = 10
"""Pulse intervals without a pulse after which a tag is reported as received again; at least
`SILENCE_S`. This is longer than the part of a turn in which the antenna points away, plus one
or two missed groups of pulses."""


class TagTexts:
    """Decides when to report that a tag is received; an unsent text is due at
    the next pulse.
    """

    def __init__(self, tags: Iterable[Tag] = ()) -> None:
        self.begin_flight(tags)

    def begin_flight(self, tags: Iterable[Tag]) -> None:
        """Reset for a new flight: a text is due when each of its tags is first received."""
        self._tags = {tag.tag_id: tag for tag in tags}
        self._last_ns: dict[int, int] = {}
        self._due: dict[int, float | None] = {}
        """Tags with a text due, and the silence before it [s]; None for the first reception."""

    def restore(self, ends_ns: Mapping[int, int]) -> None:
        """Set when each tag was last received in this flight, before this process restarted."""
        for tag_id, end_ns in ends_ns.items():
            self._last_ns[tag_id] = max(end_ns, self._last_ns.get(tag_id, end_ns))
            if tag_id in self._due and self._due[tag_id] is None:
                del self._due[tag_id]

    def text(self, pulse: Pulse) -> str | None:
        """Handle a pulse; return the text to send about its tag, or None.

        Only confirmed pulses count.
        """
        if not pulse.confirmed:
            return None
        tag_id = pulse.tag_id
        last_ns = self._last_ns.get(tag_id)
        if last_ns is None:
            self._due[tag_id] = None
        else:
            silent_s = s_from_ns(pulse.start_time_ns - last_ns)
            if silent_s > self._silence_s(tag_id):
                self._due.setdefault(tag_id, silent_s)
        self._last_ns[tag_id] = max(pulse.end_time_ns, last_ns or 0)
        return self._words(pulse) if tag_id in self._due else None

    def reported(self, tag_id: int) -> None:
        """Note that the text about a tag was sent."""
        self._due.pop(tag_id, None)

    def _silence_s(self, tag_id: int) -> float:
        tag = self._tags.get(tag_id)
        intervals_s = () if tag is None else tag.pulse_intervals_s
        return max(SILENCE_S, SILENCE_INTERVALS * max(intervals_s, default=0.0))

    def _words(self, pulse: Pulse) -> str:
        silent_s = self._due[pulse.tag_id]
        who = " or ".join(map(self._name, (pulse.tag_id, *pulse.also_possible_tag_ids)))
        again = "" if silent_s is None else f" again after {silent_s:.0f} s"
        bound = "at least " if pulse.clipped else ""
        return f"Tag {who} detected{again}: {bound}{pulse.snr_db:.1f} dB"

    def _name(self, tag_id: int) -> str:
        tag = self._tags.get(tag_id)
        return f"{tag_id}" if tag is None or not tag.name else f"{tag_id} ({tag.name})"
