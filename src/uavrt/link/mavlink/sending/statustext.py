"""Split operator texts into STATUSTEXT pieces of 50 bytes, join received pieces, and limit the
rate of texts; no I/O.
"""

from uavrt.core.newest import Newest
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.link.mavlink.dialect import MavSeverity, Statustext

CHUNK = 50
TEXT_BURST = 10
TEXTS_A_SECOND = 0.5
TEXTS_KNOWN = 64
REPEAT_NS = ns_from_s(10.0)
MAX_CHUNKS = 8
"""Largest number of STATUSTEXT pieces per text (400 bytes); more would block a radio."""


def chunks_of(text: str, severity: int, text_id: int) -> list[Statustext]:
    """Cut a text of at most 400 bytes into STATUSTEXT messages, between characters.

    A longer one has an id and numbered pieces; the last piece is shorter than 50 bytes, or
    empty.
    """
    pieces, piece = [], b""
    for character in text.replace("\0", " "):
        encoded = character.encode(errors="replace")
        if len(piece) + len(encoded) > CHUNK:
            pieces.append(piece.ljust(CHUNK).decode())  # a shorter piece would end the text
            piece = b""
        piece += encoded
    pieces = [*pieces, piece.decode()][:MAX_CHUNKS]
    if len(pieces) == 1:
        return [Statustext(severity=severity, text=pieces[0])]
    if len(pieces[-1].encode(errors="replace")) == CHUNK and len(pieces) < MAX_CHUNKS:
        pieces.append("")
    return [
        Statustext(severity=severity, text=piece, id=text_id, chunk_seq=index)
        for index, piece in enumerate(pieces)
    ]


class TextLimiter:
    """Limits uncritical texts to ten at once, then one per 2 s, without repetition within 10 s.

    Otherwise a repeated fault would fill the radio link. Texts of severity critical or higher
    are always sent.
    """

    def __init__(self) -> None:
        self._tokens = float(TEXT_BURST)
        self._filled_ns: int | None = None
        self._recent: Newest[str, int] = Newest(TEXTS_KNOWN)
        self.left_out = 0

    def allows(self, severity: int, text: str, now_ns: int) -> bool:
        """True if a text may be sent now; a refused one is counted."""
        if self._filled_ns is not None:
            elapsed_s = (now_ns - self._filled_ns) / NANOSECONDS_PER_SECOND
            self._tokens = min(TEXT_BURST, self._tokens + elapsed_s * TEXTS_A_SECOND)
        self._filled_ns = now_ns
        last_ns = self._recent.get(text)
        again = last_ns is not None and now_ns - last_ns < REPEAT_NS
        if again or (self._tokens < 1.0 and severity > MavSeverity.CRITICAL):
            self.left_out += 1
            return False
        self._tokens = max(0.0, self._tokens - 1.0)
        self._recent[text] = now_ns
        return True

    def sent_within(self, text: str, period_ns: int, now_ns: int) -> bool:
        """True if the same text was sent within the last `period_ns`."""
        last_ns = self._recent.get(text)
        return last_ns is not None and now_ns - last_ns < period_ns


class TextAssembler:
    """Joins received STATUSTEXT pieces to texts; an ellipsis replaces a missing piece."""

    def __init__(self) -> None:
        self._parts: dict[tuple[int, int], tuple[int, int, dict[int, str]]] = {}

    def add(self, sender: tuple[int, int], message: Statustext) -> list[tuple[int, str]]:
        """Handle a piece; return the texts that are now complete, as (severity, text)."""
        done: list[tuple[int, str]] = []
        open_text = self._parts.get(sender)
        if open_text is not None and open_text[0] != message.id:
            done.append(self._finish(sender))
        if message.id == 0:
            return [*done, (message.severity, message.text)]
        _, _, pieces = self._parts.setdefault(sender, (message.id, message.severity, {}))
        pieces[message.chunk_seq] = message.text
        short = len(message.text.encode(errors="replace")) < CHUNK
        if short or message.chunk_seq >= MAX_CHUNKS - 1:
            done.append(self._finish(sender))
        return done

    def _finish(self, sender: tuple[int, int]) -> tuple[int, str]:
        _, severity, pieces = self._parts.pop(sender)
        return severity, "".join(pieces.get(i, "…") for i in range(max(pieces) + 1))
