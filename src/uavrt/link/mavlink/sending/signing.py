"""MAVLink 2 signing: a signed frame can only come from a holder of the key; no I/O.

A signed frame has the flag 0x01 in its incompatibility byte and ends with 13 bytes::

    link id (1) | time (6): 10 µs since 2015-01-01 | first 6 bytes of SHA-256 of
                            key (32), the frame up to here

Times of one sender's link rise strictly; other frames are replays. The first of a
stream may be at most a minute older than this computer's time or the newest accepted time.
The newest times are stored over a restart (`SigningTimes`).

PX4 1.17 breaks the signatures of frames that it forwards; messages through it use
`uavrt.link.tunnel.own_messages.seal`.
"""

import hashlib
import hmac
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from uavrt.config.key_files import read_key_file
from uavrt.config.settings import MavlinkSettings
from uavrt.core.newest import Newest
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavComponent
from uavrt.link.mavlink.frame import SIGNATURE_SIZE, Frame

Unsigned = Literal["none", "autopilot", "all"]
"""Which unsigned frames are accepted: none, telemetry of the autopilot, or all."""

KEY_SIZE = 32
HASH_SIZE = 6
EPOCH_S = 1_420_070_400
"""Origin of signing times: 2015-01-01 UTC [s since 1970]."""
TICK_NS = 10_000
BEHIND_TICKS = 6_000_000
"""Largest accepted age of a signed stream's first frame [10 µs]: one minute."""
MAX_STREAMS = 64
COMMANDING = frozenset(
    {
        dialect.Tunnel.ID,
        dialect.CommandLong.ID,
        dialect.CommandInt.ID,
        dialect.ParamSet.ID,
        dialect.FileTransferProtocol.ID,
    }
)
"""Messages that are refused without a signature under accept_unsigned=autopilot, because any
sender can use the autopilot's component id 1."""


@dataclass(frozen=True, slots=True)
class SigningKey:
    """The secret key that all signers share; it is never shown."""

    secret: bytes

    def __repr__(self) -> str:
        return "SigningKey(…)"


def read_signing_key(path: str | Path) -> SigningKey:
    """Read a key: 64 hexadecimal digits in a file.

    MAVProxy and QGroundControl make their keys from a passphrase, as its SHA-256: ``printf %s
    PASSPHRASE | sha256sum | cut -c-64``. Raises `ConfigError` if the file has no key, or others
    may read the file.
    """
    return SigningKey(read_key_file(path, "signing key", least=KEY_SIZE, most=KEY_SIZE))


def signing_from(settings: MavlinkSettings, clock_ns: Callable[[], int]) -> "Signing | None":
    """Make `Signing` from the settings; raises `ConfigError` for an unreadable key."""
    if settings.signing_key_file is None:
        return None
    key = read_signing_key(settings.signing_key_file)
    return Signing(key, clock_ns, settings.accept_unsigned)


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningTimes:
    """The newest signing times of accepted frames [10 µs since 2015], for storage."""

    newest: int
    """Newest signing time of all streams and of this side's own frames [10 µs since 2015]."""
    streams: tuple[tuple[int, int, int, int], ...] = ()
    """System id, component id, link id and time of each stream."""


class Signing:
    """Signs frames and checks the signatures of received frames; one object for all links."""

    def __init__(
        self, key: SigningKey, clock_ns: Callable[[], int], unsigned: Unsigned = "autopilot"
    ) -> None:
        self._secret = key.secret
        self._clock_ns = clock_ns
        self._unsigned = unsigned
        self._last_ticks = 0
        self._streams: Newest[tuple[int, int, int], int] = Newest(MAX_STREAMS)
        self.counters: Counter[str] = Counter()

    def times(self) -> SigningTimes:
        """Newest signing times, to be stored over a restart."""
        streams = tuple((*stream, ticks) for stream, ticks in self._streams.items())
        return SigningTimes(newest=self._last_ticks, streams=streams)

    def remember(self, times: SigningTimes, *, behind_s: float) -> None:
        """Restore stored signing times and add `behind_s`, by which they may be out of date."""
        behind = round(behind_s * NANOSECONDS_PER_SECOND / TICK_NS)
        self._last_ticks = max(self._last_ticks, times.newest)
        for system_id, component_id, link_id, ticks in times.streams:
            self._streams[system_id, component_id, link_id] = ticks + behind

    def signature(self, frame: bytes, link_id: int) -> bytes:
        """Compute the 13 signature bytes of a frame with the signed flag."""
        self._last_ticks = max(self._last_ticks + 1, self._now_ticks())
        tail = bytes((link_id & 0xFF,)) + self._last_ticks.to_bytes(6, "little")
        return tail + self._hash(frame + tail)

    def accepts(self, frame: Frame) -> bool:
        """True if a frame's signature is valid or not required; refused frames are counted."""
        reason = (
            self._fault_of_signed(frame) if frame.signed else self._fault_of_unsigned(frame)
        )
        if reason is not None:
            self.counters[reason] += 1
        return reason is None

    def _fault_of_signed(self, frame: Frame) -> str | None:
        signature = frame.raw[-SIGNATURE_SIZE:]
        if not hmac.compare_digest(signature[-HASH_SIZE:], self._hash(frame.raw[:-HASH_SIZE])):
            return "signatures_wrong"
        ticks = int.from_bytes(signature[1:7], "little")
        stream = (frame.system_id, frame.component_id, signature[0])
        newest = self._streams.get(stream, self._now_ticks() - BEHIND_TICKS)
        if ticks <= newest:
            return "signatures_repeated"
        self._streams[stream] = ticks
        # A computer without a battery-backed clock gets the time from other senders.
        self._last_ticks = max(self._last_ticks, ticks)
        return None

    def _fault_of_unsigned(self, frame: Frame) -> str | None:
        if self._unsigned == "all" or frame.message_id == dialect.RadioStatus.ID:
            return None
        telemetry = (
            frame.component_id == MavComponent.COMP_ID_AUTOPILOT1
            and frame.message_id not in COMMANDING
        )
        return None if telemetry and self._unsigned == "autopilot" else "unsigned_refused"

    def _now_ticks(self) -> int:
        wall = max(0, self._clock_ns() - EPOCH_S * NANOSECONDS_PER_SECOND) // TICK_NS
        return max(wall, self._last_ticks)

    def _hash(self, data: bytes) -> bytes:
        return hashlib.sha256(self._secret + data).digest()[:HASH_SIZE]
