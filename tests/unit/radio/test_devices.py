"""Two radios on one computer: named before a flight, with the setting that chooses."""

from collections.abc import Callable
from pathlib import Path

import pytest

from uavrt.config.settings import RadioSettings
from uavrt.radio.receivers.devices import ambiguous_radios, usb_radios

Plug = Callable[..., None]
AIRSPY, HACKRF, RTLSDR = ("1d50", "60a1"), ("1d50", "6089"), ("0bda", "2838")


@pytest.fixture(name="plug")
def plug_fixture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Plug:
    """Plug a radio in, as the kernel would list it."""
    monkeypatch.setattr("uavrt.radio.receivers.devices.SYSFS_USB", tmp_path)

    def plug(usb: tuple[str, str], serial: str = "") -> None:
        number = len(list(tmp_path.iterdir())) + 1
        device = tmp_path / f"1-{number}"
        device.mkdir()
        names = ("idVendor", "idProduct", "busnum", "devnum", *(["serial"] if serial else []))
        for name, text in zip(names, (*usb, "1", str(number), serial), strict=False):
            (device / name).write_text(f"{text}\n")

    return plug


def remedy(kind: str) -> str | None:
    found = ambiguous_radios(RadioSettings(kind=kind))
    return None if found is None else found[1]


def test_one_radio_or_one_of_another_kind_needs_no_choice(plug: Plug) -> None:
    plug(AIRSPY, "AIRSPY SN:644064DC2F5A5ECD")
    plug(HACKRF, "0000000000000000909864c8343b55cf")
    plug(("1d6b", "0002"), "0000:01:00.0")  # a hub
    assert [radio.kind for radio in usb_radios()] == ["airspy", "hackrf"]
    assert usb_radios()[0].node == Path("/dev/bus/usb/001/001")
    assert remedy("airspy") is None
    assert remedy("hackrf") is None


def test_two_are_named_with_the_setting_as_the_program_takes_it(plug: Plug) -> None:
    plug(AIRSPY, "AIRSPY SN:644064DC2F5A5ECD")
    plug(AIRSPY, "AIRSPY SN:35AC63DC2D8C7A4F")
    assert remedy("airspy") == (
        'Set [radio] serial to "0x644064DC2F5A5ECD" or "0x35AC63DC2D8C7A4F"'
    )
    assert ambiguous_radios(RadioSettings(serial="0x644064DC2F5A5ECD")) is None
    assert ambiguous_radios(RadioSettings(program=("stand-in",))) is None


def test_two_with_the_same_serial_number_have_another_remedy(plug: Plug) -> None:
    for _ in range(2):
        plug(RTLSDR, "00000001")
        plug(HACKRF)
    assert "rtl_eeprom" in (remedy("rtlsdr") or "")
    assert "Unplug" in (remedy("hackrf") or "")
