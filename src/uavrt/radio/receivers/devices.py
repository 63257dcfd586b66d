"""List the radios that are plugged in, as reported by the kernel (sysfs-bus-usb).

With two radios of one kind, a radio program opens the first one that it finds, which may have
no antenna. So two radios of the configured kind are an error until `[radio] serial` selects
one.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from uavrt.config.radios import RADIOS
from uavrt.config.settings import RadioSettings

SYSFS_USB = Path("/sys/bus/usb/devices")
NODES = Path("/dev/bus/usb")


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbRadio:
    """A radio that is plugged into a USB port."""

    kind: str
    serial: str
    """Serial number of the radio, as in `[radio] serial`; empty if the device has none."""
    node: Path


def usb_radios() -> list[UsbRadio]:
    """List plugged-in radios of all kinds, in the order of their USB ports."""
    return list(_found())


def ambiguous_radios(settings: RadioSettings) -> tuple[str, str] | None:
    """Error text and remedy if the settings match several radios; otherwise None."""
    if settings.program or settings.serial or settings.kind not in RADIOS:
        return None
    row = RADIOS[settings.kind]
    serials = [radio.serial for radio in usb_radios() if radio.kind == settings.kind]
    if len(serials) < 2:
        return None
    if len(set(serials)) == len(serials) and all(serials):
        remedy = "Set [radio] serial to " + " or ".join(f'"{one}"' for one in serials)
    elif settings.kind == "rtlsdr":  # its programs also accept an index
        remedy = 'Set [radio] serial to "0" or "1"; rtl_eeprom -s sets different serial numbers'
    else:
        remedy = "Unplug all but one: they have no serial numbers"
    return f"{len(serials)} {row.title} radios are plugged in, and none is selected", remedy


def _found() -> Iterator[UsbRadio]:
    kinds = {usb[:2]: row for row in RADIOS.values() for usb in row.usb}
    for device in sorted(SYSFS_USB.glob("*")):
        with suppress(OSError, ValueError):
            row = kinds.get((_read(device / "idVendor"), _read(device / "idProduct")))
            if row is None:
                continue
            bus, number = int(_read(device / "busnum")), int(_read(device / "devnum"))
            serial = ""
            with suppress(OSError):
                # "AIRSPY SN:35AC63DC2D8C7A4F", which its programs take as 0x35AC63DC2D8C7A4F.
                serial = _read(device / "serial").rpartition("SN:")[2]
            yield UsbRadio(
                kind=row.kind,
                serial=serial and f"{row.serial_prefix}{serial}",
                node=NODES / f"{bus:03d}/{number:03d}",
            )


def _read(path: Path) -> str:
    return path.read_text(encoding="ascii", errors="replace").strip()
