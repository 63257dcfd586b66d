"""The radios' own programs: their arguments, and the meaning of their error texts.

The table is `uavrt.config.radios`; what each program's arguments are stands in its module. The
programs are run as they are; nothing of them is linked.
"""

import os
from importlib import import_module

from uavrt.config import RADIOS, RadioRow, RadioSettings
from uavrt.errors import ConfigError, RadioError, RadioMissing, RadioStopped
from uavrt.radio.devices import usb_radios

PROGRAMS: dict[str, RadioRow] = {kind: row for kind, row in RADIOS.items() if row.receive}
"""The radios that have one."""


def receive_command(settings: RadioSettings, center_frequency_hz: float) -> list[str]:
    """Build the argument list of the radio's program; its samples go to stdout.

    Raises
    ------
    ConfigError
        A setting that this radio does not have.
    """
    program = PROGRAMS[_known(settings.kind)]
    gain = (program.default_gain or 0) if settings.gain is None else settings.gain
    lowest, highest = program.gains
    if not lowest <= gain <= highest:
        raise ConfigError(
            f"gain {gain} is not possible with {program.title}",
            remedy=f"Set [radio] gain between {lowest} and {highest}",
        )
    # A stand-in (`program`) may offer any rate.
    if not settings.program and not program.takes_rate(settings.sample_rate_hz):
        raise ConfigError(
            f"{settings.sample_rate_hz:.0f} samples a second are not possible with "
            f"{program.title}",
            remedy=f"Set [radio] sample_rate_hz to {program.rates_text()}",
        )
    if not 1e6 <= center_frequency_hz <= 6e9:
        raise ConfigError(
            f"radio frequency {center_frequency_hz} Hz is not possible",
            remedy="Give it in hertz, e.g. 148.7e6",
        )
    arguments: list[str] = import_module(program.module).arguments(
        settings, center_frequency_hz, gain
    )
    return [*(settings.program or (program.receive,)), *arguments]


def commands_before(settings: RadioSettings) -> list[list[str]]:
    """List what must be run before the radio's program."""
    if settings.program or settings.kind not in PROGRAMS:
        return []
    module = import_module(PROGRAMS[settings.kind].module)
    before: list[list[str]] = (
        module.commands_before(settings) if hasattr(module, "commands_before") else []
    )
    return before


def _known(kind: str) -> str:
    if kind in PROGRAMS:
        return kind
    raise ConfigError(
        f"unknown radio {kind!r}",
        remedy=f"Set [radio] kind to one of {', '.join(RADIOS)}",
    )


_FORBIDDEN = ("usb_open error -3", "LIBUSB_ERROR_ACCESS", "Access denied", "Permission denied")
_BUSY = ("usb_claim_interface error -6", "LIBUSB_ERROR_BUSY", "_ERROR_BUSY", "Resource busy")
_RATE = (
    "set_samplerate() failed",
    "unsupported sample rate",
    "sample_rate_hz should be",
    "Failed to set sample rate",
)
_FREQUENCY = ("argument error: frequency", "set_freq() failed", "Failed to set center freq")


def says_absent(text: str) -> bool:
    """Whether a radio program's words mean that there is no device."""
    return any(words in text for row in RADIOS.values() for words in row.absent)


def exit_error(settings: RadioSettings, code: int, said: str, words: str) -> RadioError:
    """Turn the end of a radio's program into an error that names the remedy.

    Parameters
    ----------
    settings : RadioSettings
        Settings of the radio.
    code : int
        Exit status; negative for a signal.
    said : str
        The status in words.
    words : str
        Its first lines on stderr, which hold the cause, and the last ones.
    """
    row = RADIOS[settings.kind]
    message = f"{row.title}: the radio's program {said}"
    if words:
        message += f": {words}"
    remedy = _remedy_of_missing(settings, row, words)
    if remedy is not None:
        return RadioMissing(message, remedy=remedy)
    if any(one in words for one in _RATE):
        remedy = f"Set [radio] sample_rate_hz to {row.rates_text()}"
    elif any(one in words for one in _FREQUENCY):
        remedy = "Set [radio] center_frequency_hz, or the tags, to what this radio receives"
    elif code == -9:
        remedy = "Check the free memory: the kernel or a user killed the program"
    else:
        remedy = "Check the radio's cable and power; it is started again by itself in flight"
    return RadioStopped(message, remedy=remedy)


def _remedy_of_missing(settings: RadioSettings, row: RadioRow, words: str) -> str | None:
    """Get the remedy if no radio could be opened; None if one could.

    The programs say "not found" also of a radio that another program uses, or that may not be
    opened; the kernel's list of USB devices distinguishes them.
    """
    forbidden = any(one in words for one in _FORBIDDEN)
    busy = any(one in words for one in _BUSY)
    if not (forbidden or busy or says_absent(words)):
        return None
    there = [one for one in usb_radios() if one.kind == row.kind]
    # Programs take hexadecimal digits of either case, hackrf_transfer also the last ones alone.
    wanted = (settings.serial or "").casefold().removeprefix("0x")
    chosen = [one for one in there if one.serial.casefold().endswith(wanted)]
    if there and not chosen and not (forbidden or busy):
        serials = ", ".join(f'"{one.serial}"' for one in there)
        return f"Set [radio] serial to {serials}, which is plugged in"
    if forbidden or any(not os.access(one.node, os.R_OK | os.W_OK) for one in chosen):
        return (
            f"Plug the radio in again (the package {row.package} has installed a rule that "
            "lets users open it), or add the user to the group plugdev"
        )
    if busy or chosen:
        return "Close the other program that uses the radio"
    return "Plug the radio in, or try another cable or port"
