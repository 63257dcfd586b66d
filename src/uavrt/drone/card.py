"""Health of the memory card and of the clock's battery, as reported by the kernel.

ext4 (kernel documentation, "ext4 General Information", sysfs) counts errors and kilobytes
written. After an error it becomes read-only where ``errors=remount-ro`` is set, as on Debian
and Raspberry Pi OS. An SD card does not report wear; an eMMC reports ``life_time`` in tenths
(JEDEC JESD84, EXT_CSD [268], [269]).
"""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from uavrt.core.clock import wall_ns
from uavrt.core.units import NANOSECONDS_PER_SECOND, rough_duration

MOUNTS = Path("/proc/self/mounts")
SYSFS = Path("/sys")
WORN_TENTHS = 9
"""Used share of an eMMC's rated life from which the memory counts as worn out [tenths]."""
NEW_CARD = "Fetch the flights, then use a new card"
OLDEST_TIME_NS = 1_750_000_000 * 10**9
"""Earliest plausible time, June 2025 [ns]; a clock that shows an earlier time was never set."""
BATTERY_CLOCK_OFF_S = 5.0
"""Error of the battery-backed clock from which it counts as faulty [s]; the clock counts whole
seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """State of the file system that holds the flights, and of its memory card."""

    device: str
    """Mounted device, such as ``/dev/mmcblk0p2``."""
    kind: str
    read_only: bool
    errors: int | None
    """Number of file-system errors since the last check (fsck); None if not counted."""
    written_gb: float | None
    life_used_tenths: int | None

    def faults(self) -> list[str]:
        """Return one text for each fault of the file system or card; empty without faults."""
        found = []
        if self.read_only:
            found.append("the file system is read-only and records nothing more")
        if self.errors:
            found.append(f"file-system errors: {self.errors}")
        if (self.life_used_tenths or 0) >= WORN_TENTHS:
            found.append("the flash memory is worn out")
        return found


def card_of(directory: Path) -> Card | None:
    """Read the state of the file system that holds a directory; None if it is unknown."""
    place = directory.resolve()
    mounted = {Path(where): (device, kind) for device, where, kind in _mounts()}
    for above in (place, *place.parents):
        if above in mounted:
            device, kind = mounted[above]
            break
    else:
        return None
    name = os.path.basename(os.path.realpath(device)) if device.startswith("/dev/") else ""
    about = SYSFS / "fs" / kind / name
    written_kb = _number(about / "lifetime_write_kbytes") if name else None
    errors = _number(about / "errors_count") if name else None
    return Card(
        device=device,
        kind=kind,
        # Without a counted error there is none, and no test write is needed.
        read_only=_is_mounted_so(place) or (errors != 0 and _refuses_writing(place)),
        errors=errors,
        written_gb=None if written_kb is None else written_kb / 1e6,
        life_used_tenths=_life_used(name) if name else None,
    )


def _is_mounted_so(directory: Path) -> bool:
    with suppress(OSError):
        return bool(os.statvfs(directory).f_flag & os.ST_RDONLY)
    return False


def _refuses_writing(directory: Path) -> bool:
    """Try to create a file; True if the kernel refuses it because the file system is read-only.

    Before Linux 6.15 no flag shows this.
    """
    try:
        os.close(os.open(directory, os.O_TMPFILE | os.O_WRONLY, 0o600))
    except OSError as error:
        return error.errno == errno.EROFS
    return False


def _mounts() -> Iterator[tuple[str, str, str]]:
    with suppress(OSError):
        for line in MOUNTS.read_text(encoding="utf-8", errors="replace").splitlines():
            device, where, kind, *_ = line.split(" ")
            yield device, where.encode().decode("unicode_escape"), kind


def _life_used(name: str) -> int | None:
    with suppress(OSError, ValueError):
        disk = (SYSFS / "class/block" / name).resolve().parent
        used = (disk / "device/life_time").read_text().split()
        return max(int(tenths, 16) for tenths in used)
    return None


def _number(path: Path) -> int | None:
    with suppress(OSError, ValueError):
        return int(path.read_text())
    return None


def battery_clock_off_s() -> float | None:
    """Return how far the battery-backed clock is ahead of the system clock [s].

    None without a battery-backed clock, which counts whole seconds.
    """
    kept_s = _number(SYSFS / "class/rtc/rtc0/since_epoch")
    return None if kept_s is None else kept_s - wall_ns() / NANOSECONDS_PER_SECOND


def clock_is_lost() -> bool:
    """True if this computer's clock is earlier than `OLDEST_TIME_NS`, so it was never set."""
    return wall_ns() < OLDEST_TIME_NS


def clock_fault() -> str | None:
    """Describe a fault of this computer's clocks: the time was never set, or the
    battery-backed clock is wrong. None if there is no fault.
    """
    if clock_is_lost():
        seconds = wall_ns() // NANOSECONDS_PER_SECOND
        return time.strftime("the clock shows %Y-%m-%d %H:%M UTC", time.gmtime(seconds))
    off_s = battery_clock_off_s()
    if off_s is not None and abs(off_s) > BATTERY_CLOCK_OFF_S:
        way = "ahead" if off_s > 0 else "behind"
        return f"the battery-backed clock is {rough_duration(off_s)} {way}"
    return None
