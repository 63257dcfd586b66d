"""Cause and remedy when a radio's program ends, from the real programs' texts (Debian 12)."""

from pathlib import Path

import pytest

from uavrt.config.radios import RADIOS
from uavrt.config.settings import RadioSettings
from uavrt.core.errors import RadioError, RadioMissing, RadioStopped
from uavrt.radio.receivers import devices
from uavrt.radio.receivers import program_messages as answers
from uavrt.radio.receivers.program_messages import exit_error

NOT_FOUND = {
    "airspy": "airspy_open_sn() failed: AIRSPY_ERROR_NOT_FOUND (-5)",
    "airspyhf": "airspyhf_open() failed",
    "rtlsdr": "Found 1 device(s): | 0:  Realtek, RTL2838UHIDIR, SN: 7 | No matching devices",
    "hackrf": "hackrf_open() failed: HackRF not found (-5)",
}


def cause(kind: str, words: str, code: int = 1, serial: str | None = None) -> RadioError:
    return exit_error(RadioSettings(kind=kind, serial=serial), code, "ended", words)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("airspy", "airspy_set_samplerate() failed: AIRSPY_ERROR_LIBUSB (-1000)"),
        ("airspy", "argument error: unsupported sample rate"),
        ("airspyhf", "argument error: unsupported sample rate: 600000"),
        ("rtlsdr", "Invalid sample rate: 500000 Hz | WARNING: Failed to set sample rate."),
        ("hackrf", "argument error: sample_rate_hz should be greater than or equal to 2000000"),
    ],
)
def test_a_rate_that_the_radio_refuses_is_answered_with_those_that_it_takes(
    kind: str, words: str
) -> None:
    error = cause(kind, words)
    assert isinstance(error, RadioStopped)
    assert error.remedy == f"Set [radio] sample_rate_hz to {RADIOS[kind].rates_text()}"


def test_a_frequency_that_the_radio_does_not_receive_is_named() -> None:
    words = "argument error: frequency 40000000 Hz out of range | airspyhf_rx | Usage:"
    assert "0.009 to 31 or 60 to 260 MHz" in (cause("airspyhf", words).remedy or "")
    assert "cable" in (cause("rtlsdr", "Library error -5, exiting...", 5).remedy or "")


@pytest.mark.parametrize("kind", NOT_FOUND)
def test_absent_forbidden_busy_and_another_one_have_each_their_remedy(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The libraries report "not found" for all four."""
    for module in (answers, devices):
        monkeypatch.setattr(module, "SYSFS_USB", tmp_path / "sys")
    monkeypatch.setattr(devices, "NODES", tmp_path / "dev")

    def remedy(serial: str | None = None) -> str:
        error = cause(kind, NOT_FOUND[kind], serial=serial)
        assert isinstance(error, RadioMissing)
        return error.remedy or ""

    assert remedy().startswith("Plug the radio in, or try another cable")
    device = tmp_path / "sys" / "1-1"
    device.mkdir(parents=True)
    vendor, product, _ = RADIOS[kind].usb[0]
    values = {"idVendor": vendor, "idProduct": product, "busnum": "1", "devnum": "4"}
    for name, text in (values | {"serial": "AB12"}).items():
        (device / name).write_text(text)
    assert "group plugdev" in remedy(), "there is a device that we may not open"
    node = tmp_path / "dev" / "001" / "004"
    node.parent.mkdir(parents=True)
    node.touch()
    assert remedy() == "Close the program that uses the radio"
    named = f'"{RADIOS[kind].serial_prefix}AB12"'
    other = f"Set [radio] serial to {named}, the radio that is plugged in"
    assert remedy(serial="77") == other
    assert "Close the program" in remedy(serial=f"{RADIOS[kind].serial_prefix}ab12")


@pytest.mark.parametrize(
    "words", ["Library error -5, exiting...", "Couldn't transfer any bytes"]
)
def test_a_radio_that_the_list_of_usb_devices_never_had_is_absent_or_of_another_make(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (answers, devices):
        monkeypatch.setattr(module, "SYSFS_USB", tmp_path)
    error = exit_error(RadioSettings(kind="hackrf"), 1, "ended", words, seen=False)
    assert words in error.message
    assert "plug the radio in, or, if it is of another make, check its cable" in str(error)
    unplugged = exit_error(RadioSettings(kind="hackrf"), 1, "ended", words, seen=True)
    assert "no radio is plugged in" in str(unplugged)
