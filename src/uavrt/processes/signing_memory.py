"""Newest times of signed frames, kept in a file, so that replays fail after a restart.

The file is written every 2 s, unsynced: it survives the process at once, a power cut after up
to half a minute. So times count as 3 s later after a restart of the process, as 40 s later
after one of the computer; a genuine sender has soon passed that.
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
    """Contents of the file."""

    boot_id: str
    times: SigningTimes


class SigningMemory:
    """Keeps the times of one `Signing` in a file of a directory."""

    def __init__(self, signing: Signing, directory: Path) -> None:
        self._signing = signing
        self._file = KeptFile(directory / TIMES_NAME, SigningKept, "signing times", sync=False)
        self.write = self._file.keep
        self._next_ns = 0
        self._written: SigningTimes | None = None
        self._load()

    def due(self, now_ns: int) -> SigningKept | None:
        """Get what `write` is to write, if it is time and something changed."""
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
