"""The newest times of signed frames, kept in a file: what was said before a restart is old.

The file is written every 2 s without being forced to the disk: it outlives the process at once,
and a power cut after the half minute in which the kernel writes it. So after a restart of the
process times are taken as 3 s later than they were written, after one of the computer as 40 s;
a genuine sender has passed that by then, or soon.
"""

from pathlib import Path

import msgspec

from uavrt.log import get_logger
from uavrt.mavlink import Signing, SigningTimes
from uavrt.whole_file import make_directories, write_whole

log = get_logger()

TIMES_NAME = "signing_times.json"
PERIOD_NS = 2_000_000_000
BEHIND_S, BEHIND_AFTER_BOOT_S = 3.0, 40.0
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class _Kept(msgspec.Struct):
    """What the file holds."""

    boot_id: str
    times: SigningTimes


class SigningMemory:
    """Keeps the times of one `Signing`.

    Parameters
    ----------
    signing : Signing
        Whose.
    directory : Path
        Where the file is.
    """

    def __init__(self, signing: Signing, directory: Path) -> None:
        self._signing = signing
        self._path = directory / TIMES_NAME
        self._next_ns = 0
        self._written: SigningTimes | None = None
        self._boot_id = _boot_id()
        self._load()

    def due(self, now_ns: int) -> bytes | None:
        """Get what is to be written by `write`, if it is time and there is news."""
        if now_ns < self._next_ns:
            return None
        self._next_ns = now_ns + PERIOD_NS
        times = self._signing.times()
        if self._written is not None and times.streams == self._written.streams:
            return None
        self._written = times
        return msgspec.json.encode(_Kept(boot_id=self._boot_id, times=times))

    def write(self, content: bytes) -> None:
        """Replace the file."""
        try:
            make_directories(self._path.parent)
            write_whole(self._path, content, sync=False)
        except OSError as error:
            log.warning("signing times not kept", reason=str(error.strerror))

    def _load(self) -> None:
        try:
            kept = msgspec.json.decode(self._path.read_bytes(), type=_Kept)
        except FileNotFoundError:
            return
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            log.warning("signing times not read: old frames may be taken", reason=str(error))
            return
        same_boot = kept.boot_id == self._boot_id
        behind_s = BEHIND_S if same_boot else BEHIND_AFTER_BOOT_S
        self._signing.remember(kept.times, behind_s=behind_s)


def _boot_id() -> str:
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return "unknown"
