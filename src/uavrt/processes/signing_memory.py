"""The newest times of signed frames, kept in a file: what was said before a restart is old.

The file is written every 2 s without being forced to the disk: it outlives the process at once,
and a power cut after the half minute in which the kernel writes it. So after a restart of the
process times are taken as 3 s later than they were written, after one of the computer as 40 s;
a genuine sender has passed that by then, or soon.
"""

from pathlib import Path

import msgspec

from uavrt.clock import boot_id
from uavrt.mavlink.signing import Signing, SigningTimes
from uavrt.recording.kept_file import KeptFile

TIMES_NAME = "signing_times.json"
PERIOD_NS = 2_000_000_000
BEHIND_S, BEHIND_AFTER_BOOT_S = 3.0, 40.0


class SigningKept(msgspec.Struct):
    """What the file holds."""

    boot_id: str
    times: SigningTimes


class SigningMemory:
    """Keeps the times of one `Signing`.

    `directory`: where the file is.
    """

    def __init__(self, signing: Signing, directory: Path) -> None:
        self._signing = signing
        self._file = KeptFile(directory / TIMES_NAME, SigningKept, "signing times", sync=False)
        self.write = self._file.keep
        self._next_ns = 0
        self._written: SigningTimes | None = None
        self._load()

    def due(self, now_ns: int) -> SigningKept | None:
        """Get what is to be written by `write`, if it is time and there is news."""
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
