"""Find cause and remedy for the error messages of radio programs.

The messages were collected from the programs of Debian 12 (airspy 1.0.10, airspyhf 1.6.8,
rtl-sdr 0.6.0, hackrf 2022.09.1) and SoapySDR 0.8.1. The libraries report "not found" even for a
radio that another program uses or that this user may not open; the list of USB devices
distinguishes these cases.
"""

import os
from collections.abc import Callable, Iterable
from enum import Enum, auto

from uavrt.config.radios import RADIOS, RadioRow
from uavrt.config.settings import RadioSettings
from uavrt.core.errors import RadioError, RadioMissing, RadioStalled, RadioStopped
from uavrt.radio.receivers.devices import SYSFS_USB, UsbRadio, usb_radios


class Cause(Enum):
    """Reasons why a radio delivers no samples."""

    ABSENT = auto()
    """The radio is missing, in use or forbidden; the program's message is the same for all."""
    FORBIDDEN = auto()
    BUSY = auto()
    RATE = auto()
    FREQUENCY = auto()
    STALLED = auto()
    SLOW_READER = auto()


ANSWERS: tuple[tuple[str, str, Cause], ...] = (
    ("airspy_rx", "AIRSPY_ERROR_NOT_FOUND", Cause.ABSENT),
    ("airspy_rx", "AIRSPY_ERROR_BUSY", Cause.BUSY),
    ("airspy_rx", "airspy_set_samplerate() failed", Cause.RATE),
    ("airspy_rx", "unsupported sample rate", Cause.RATE),
    ("airspy_rx", "argument error: frequency_MHz", Cause.FREQUENCY),
    ("airspy_rx", "airspy_set_freq() failed", Cause.FREQUENCY),
    ("airspyhf_rx", "airspyhf_open() failed", Cause.ABSENT),
    ("airspyhf_rx", "airspyhf_open_sn() failed", Cause.ABSENT),
    ("airspyhf_rx", "unsupported sample rate", Cause.RATE),
    ("airspyhf_rx", "airspyhf_set_samplerate() failed", Cause.RATE),
    ("airspyhf_rx", "argument error: frequency", Cause.FREQUENCY),
    ("airspyhf_rx", "airspyhf_set_freq() failed", Cause.FREQUENCY),
    ("rtl_sdr", "usb_open error -3", Cause.FORBIDDEN),
    ("rtl_sdr", "usb_claim_interface error -6", Cause.BUSY),
    ("rtl_sdr", "Failed to set sample rate", Cause.RATE),
    ("rtl_sdr", "Failed to set center freq", Cause.FREQUENCY),
    ("rtl_sdr", "No supported devices", Cause.ABSENT),
    ("rtl_sdr", "No matching devices", Cause.ABSENT),
    ("rtl_sdr", "Failed to open rtlsdr device", Cause.ABSENT),
    ("rtl_sdr", "samples lost, exiting", Cause.SLOW_READER),
    ("hackrf_transfer", "HackRF not found", Cause.ABSENT),
    ("hackrf_transfer", "_ERROR_NOT_FOUND", Cause.ABSENT),
    ("hackrf_transfer", "Access denied", Cause.FORBIDDEN),
    ("hackrf_transfer", "Resource busy", Cause.BUSY),
    ("hackrf_transfer", "sample_rate_hz should be", Cause.RATE),
    ("hackrf_transfer", "hackrf_set_sample_rate() failed", Cause.RATE),
    ("hackrf_transfer", "freq_hz should be", Cause.FREQUENCY),
    ("hackrf_transfer", "freq_hz must be", Cause.FREQUENCY),
    ("hackrf_transfer", "hackrf_set_freq() failed", Cause.FREQUENCY),
    ("hackrf_transfer", "Couldn't transfer any bytes", Cause.STALLED),
    ("SoapySDR", "no match", Cause.ABSENT),
    ("SoapySDR", "no enumeration results", Cause.ABSENT),
    ("SoapySDR", "not found", Cause.ABSENT),
    ("SoapySDR", "Resource busy", Cause.BUSY),
    ("SoapySDR", "Access denied", Cause.FORBIDDEN),
    ("SoapySDR", "sample rate", Cause.RATE),
    ("SoapySDR", "frequency", Cause.FREQUENCY),
)
"""Known messages of radio programs: program, part of its output, and cause; the first match
counts."""


_NOT_LISTED = (
    "No USB device of a known make is plugged in: plug the radio in, or, if it is of another "
    "make, check its cable and power"
)


def cause_of(row: RadioRow, words: str) -> Cause | None:
    """Cause of a failure according to a radio program's output; None if it is not known."""
    program = row.receive or row.title
    means = (one for name, text, one in ANSWERS if name == program and text in words)
    return next(means, None)


def exit_error(
    settings: RadioSettings,
    code: int,
    said: str,
    words: str,
    *,
    own_rates: Callable[[], str] = str,
    seen: bool = True,
) -> RadioError:
    """Create the error for a radio program that has ended, with cause and remedy.

    `code`: exit code; negative for a signal. `said`: phrase on how the program ended. `words`:
    first and last lines of the program on stderr; the first ones show the cause. `own_rates`:
    returns the sample rates that the radio reports. `seen`: True if the radio was plugged in at
    the start of the program; if it is missing now, it was unplugged.
    """
    row = RADIOS[settings.kind]
    cause = cause_of(row, words)
    there = [one for one in usb_radios() if one.kind == row.kind]
    listed = row.usb and SYSFS_USB.is_dir() and not settings.program
    message = f"{row.title}: the radio's program {said}" + (f": {words}" if words else "")
    if cause in (None, Cause.STALLED) and code >= 0 and listed and not there:
        if not seen:
            return RadioStopped(message, remedy=_NOT_LISTED)
        cause = Cause.ABSENT  # unplugged
    if cause in (Cause.ABSENT, Cause.FORBIDDEN, Cause.BUSY):
        why, remedy = _missing(settings, row, there, cause)
        return RadioMissing(f"{row.title}: {why}", remedy=remedy)
    if cause is Cause.STALLED:
        return stalled(row.title)
    if cause is Cause.RATE:
        why = f"{settings.sample_rate_hz:.0f} samples a second are not supported"
        rates = own_rates() or row.rates_text()
        return RadioStopped(
            f"{row.title}: {why}", remedy=f"Set [radio] sample_rate_hz to {rates}"
        )
    if cause is Cause.FREQUENCY:
        return RadioStopped(
            f"{row.title}: the radio does not receive the frequency",
            remedy=f"Set [radio] center_frequency_hz within {row.receives_text()}",
        )
    if cause is Cause.SLOW_READER:
        remedy = "See what else keeps this computer busy: top"
    elif code == -9:
        remedy = "Check the free memory: the kernel or a user killed the program"
    else:
        remedy = "Check the radio's cable and power; it is started again by itself in flight"
    return RadioStopped(message, remedy=remedy)


def stalled(title: str) -> RadioStalled:
    """Create the error for a radio that was opened but delivers no samples."""
    return RadioStalled(
        f"{title}: no samples arrive",
        remedy="Unplug the radio and plug it in again; try another cable or port",
    )


def serial_error(settings: RadioSettings, serials: Iterable[str]) -> RadioMissing:
    """Create the error for a configured serial number that no plugged-in radio has."""
    why, remedy = _other_serial(settings, serials)
    return RadioMissing(f"{RADIOS[settings.kind].title}: {why}", remedy=remedy)


def _other_serial(settings: RadioSettings, serials: Iterable[str]) -> tuple[str, str]:
    there = " or ".join(f'"{one}"' for one in serials)
    return (
        f"no radio has the serial number {settings.serial}",
        f"Set [radio] serial to {there}, the radio that is plugged in",
    )


def _missing(
    settings: RadioSettings, row: RadioRow, there: list[UsbRadio], cause: Cause
) -> tuple[str, str]:
    """Find out why no radio could be opened; return cause and remedy as texts."""
    # Programs take hexadecimal digits of either case, hackrf_transfer also the last ones alone.
    wanted = (settings.serial or "").casefold().removeprefix("0x")
    chosen = [one for one in there if one.serial.casefold().endswith(wanted)]
    if there and not chosen and cause is Cause.ABSENT:
        return _other_serial(settings, [one.serial for one in there])
    closed = [one for one in chosen if not os.access(one.node, os.R_OK | os.W_OK)]
    if cause is Cause.FORBIDDEN or closed:
        return (
            "this user may not open it",
            "Install the udev rule (sudo uavrt service install), join the group plugdev, and "
            "plug the radio in again",
        )
    if cause is Cause.BUSY or chosen:
        return "another program is using the radio", "Close the program that uses the radio"
    if not row.usb:
        return (
            "no radio is found",
            "Plug the radio in, close other programs that use it, and install its SoapySDR "
            "module (soapysdr-module-…)",
        )
    return "no radio is plugged in", "Plug the radio in, or try another cable or port"
