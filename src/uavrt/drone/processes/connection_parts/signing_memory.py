"""Store the newest times of signed frames in a file, to reject replays after a restart.

The file is written every 2 s, unsynced. It survives the end of the process, but a power cut may
lose half a minute. So the times are increased by 3 s after a restart and by 40 s after a
reboot; a genuine sender's clock soon passes them.
"""

from pathlib import Path

import msgspec

from uavrt.core.clock import boot_id
from uavrt.flight.kept_file import KeptFile
from uavrt.link.mavlink.sending.signing import Signing, SigningTimes

TIMES_NAME = "signing_times.json"
PERIOD_NS = 2_000_000_000
BEHIND_S, BEHIND_AFTER_BOOT_S = 3.0, 40.0


class SigningKept(msgspec.Struct):
    """Contents of the file: newest signing times, and the boot in which they were written."""

    boot_id: str
    times: SigningTimes


class SigningMemory:
    """Stores the newest signing times of `Signing` in a file, and loads them at the start."""

    def __init__(self, signing: Signing, directory: Path) -> None:
        self._signing = signing
        self._file = KeptFile(directory / TIMES_NAME, SigningKept, "signing times", sync=False)
        self.write = self._file.keep
        self._next_ns = 0
        self._written: SigningTimes | None = None
        self._load()

    def due(self, now_ns: int) -> SigningKept | None:
        """Return the signing times to be written now; None if not due or unchanged."""
        if now_ns < self._next_ns:
            return None
        self._next_ns = now_ns + PERIOD_NS
        times = self._signing.times()
        if self._written is not None and times.streams == self._written.streams:
            return None
        self._written = times
        return SigningKept(boot_id=boot_id(), times=times)

    def _load(self) -> None:
        if (kept := self._file.read()) is None:
            return
        behind_s = BEHIND_S if kept.boot_id == boot_id() else BEHIND_AFTER_BOOT_S
        self._signing.remember(kept.times, behind_s=behind_s)
