"""SNR and pulse count of each tag as MAVLink named values, for other ground stations.

The values are sent at a low rate, and only when no pulse waits.
"""

import string
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Mapping

from uavrt.config.settings import NamedValuesName
from uavrt.core.messages import Pulse
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.dialect import NamedValueFloat

PERIOD_NS = ns_from_s(0.25)
"""Time between two NAMED_VALUE_FLOAT messages [ns]; they take a tenth of the slowest link."""
TAG_PERIOD_NS = ns_from_s(1.0)
"""Time between two NAMED_VALUE_FLOAT messages about the same tag [ns]."""
FRESH_NS = ns_from_s(5.0)
"""Age from which an unsent SNR and pulse count is dropped [ns]; the next pulse brings newer
ones."""
NS_PER_MS = 1_000_000
NAME_BYTES = 10
DECIMAL_BELOW = 10 ** (NAME_BYTES - len("SNR_"))
_DIGITS = string.digits + string.ascii_uppercase


class NamedValues:
    """Queues each tag's newest SNR and pulse count as a message source (`pacing.Source`)."""

    def __init__(
        self,
        which: NamedValuesName,
        *,
        wanted: Callable[[], bool],
        pulses_wait: Callable[[], bool],
    ) -> None:
        self._which = which
        self._wanted, self._pulses_wait = wanted, pulses_wait
        self._counts: Counter[int] = Counter()
        self._news: OrderedDict[int, tuple[int, float]] = OrderedDict()
        """Time [ns] and SNR [dB] of each tag's last pulse, in the order of sending."""
        self._sent_ns: dict[int, int] = {}
        self._outgoing: deque[NamedValueFloat] = deque()
        self._free_ns = 0

    def begin_flight(self) -> None:
        """Reset the counts for a new flight."""
        self._counts.clear()
        self._news.clear()
        self._outgoing.clear()

    def restore(self, counts: Mapping[int, int]) -> None:
        """Add the pulses that this flight had before a restart of this process."""
        self._counts.update(counts)

    def heard(self, pulse: Pulse, now_ns: int) -> None:
        """Count a confirmed pulse, and keep its SNR for the tag's next message."""
        if pulse.confirmed and self._which != "off":
            self._counts[pulse.tag_id] += 1
            self._news[pulse.tag_id] = now_ns, pulse.snr_db

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until the next message is due [ns]; None without any."""
        if not self._wanted() or self._pulses_wait():
            return None
        gap_ns = max(0, self._free_ns - now_ns)
        if self._outgoing:
            return gap_ns
        self._forget_stale(now_ns)
        waits = (self._wait_of(tag_id, now_ns) for tag_id in self._news)
        first_ns = min(waits, default=None)
        return None if first_ns is None else max(gap_ns, first_ns)

    def take(self, now_ns: int, rate_bytes_s: float) -> NamedValueFloat | None:
        """Return the message that is due, or None. A tag's SNR comes first, then its count."""
        if self.wait_ns(now_ns) != 0:
            return None
        if not self._outgoing:
            self._write_next(now_ns)
        self._free_ns = now_ns + PERIOD_NS
        return self._outgoing.popleft()

    def _write_next(self, now_ns: int) -> None:
        tag_id = next(tag for tag in self._news if not self._wait_of(tag, now_ns))
        _, snr_db = self._news.pop(tag_id)
        self._sent_ns[tag_id] = now_ns
        values = {"SNR": snr_db}
        if self._which == "all":
            values["CNT"] = float(self._counts[tag_id])
        for kind, value in values.items():
            self._outgoing.append(
                NamedValueFloat(
                    time_boot_ms=now_ns // NS_PER_MS & 0xFFFFFFFF,
                    value=value,
                    name=value_name(kind, tag_id),
                )
            )

    def _wait_of(self, tag_id: int, now_ns: int) -> int:
        sent_ns = self._sent_ns.get(tag_id)
        return 0 if sent_ns is None else max(0, sent_ns + TAG_PERIOD_NS - now_ns)

    def _forget_stale(self, now_ns: int) -> None:
        stale = [tag for tag, (at_ns, _) in self._news.items() if now_ns - at_ns > FRESH_NS]
        for tag_id in stale:
            del self._news[tag_id]


def value_name(kind: str, tag_id: int) -> str:
    """Return the name of a tag's value in at most ten bytes, such as ``SNR_2``.

    Ids of up to six digits are written in decimal. A longer id is written in base 36 without
    the underscore (``SNRLFLS`` is tag 1 000 000).
    """
    if tag_id < DECIMAL_BELOW:
        return f"{kind}_{tag_id}"
    digits = ""
    while tag_id:
        tag_id, digit = divmod(tag_id, len(_DIGITS))
        digits = _DIGITS[digit] + digits
    return kind + digits
