"""The radios' own programs: their argument lists, and what their last words mean.

Checked against the programs of Debian 12: airspy 1.0.10, airspyhf 1.6.8, rtl-sdr 0.6.0,
hackrf 2022.09.1. They are run as they are; nothing of them is linked.
"""

from dataclasses import dataclass

from uavrt.config.parameters import GAIN_RANGES
from uavrt.config.settings import RadioKind, RadioSettings
from uavrt.errors import ConfigError, RadioError, RadioMissing, RadioStopped
from uavrt.radio.formats import CF32, CI8, CU8, SampleFormat


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioProgram:
    """What to run for one kind of radio."""

    kind: RadioKind
    title: str
    """The radio's name for people."""
    package: str
    """Debian package with the programs."""
    receive: str
    """Program that writes samples to stdout."""
    inform: tuple[str, ...]
    """Program that tells whether a device is there."""
    sample_format: SampleFormat
    gains: tuple[int, int]
    """Lowest and highest gain in the radio's own steps."""
    default_gain: int
    rates_hz: tuple[float, float]
    """Lowest and highest sample rate."""
    overruns_option: str = ""
    """Option, in versions that have it, that makes the program count its overruns on stderr."""


AIRSPY = RadioProgram(
    kind="airspy",
    title="Airspy",
    package="airspy",
    receive="airspy_rx",
    inform=("airspy_info",),
    sample_format=CF32,
    gains=GAIN_RANGES["airspy"],
    default_gain=21,
    rates_hz=(1e6, 10e6),
)
AIRSPYHF = RadioProgram(
    kind="airspyhf",
    title="Airspy HF+",
    package="airspyhf",
    receive="airspyhf_rx",
    inform=("airspyhf_info",),
    sample_format=CF32,
    gains=GAIN_RANGES["airspyhf"],
    default_gain=8,
    rates_hz=(1e5, 1e6),
)
RTLSDR = RadioProgram(
    kind="rtlsdr",
    title="RTL-SDR",
    package="rtl-sdr",
    receive="rtl_sdr",
    inform=("rtl_eeprom",),
    sample_format=CU8,
    gains=GAIN_RANGES["rtlsdr"],
    default_gain=40,
    # The RTL2832 resamples properly only within 225 to 300 kS/s and 0.9 to 3.2 MS/s.
    rates_hz=(225e3, 3.2e6),
)
HACKRF = RadioProgram(
    kind="hackrf",
    title="HackRF",
    package="hackrf",
    receive="hackrf_transfer",
    inform=("hackrf_info",),
    sample_format=CI8,
    gains=GAIN_RANGES["hackrf"],
    default_gain=64,
    rates_hz=(2e6, 20e6),
    overruns_option="-B",
)
PROGRAMS: dict[str, RadioProgram] = {
    program.kind: program for program in (AIRSPY, AIRSPYHF, RTLSDR, HACKRF)
}


def receive_command(settings: RadioSettings, center_frequency_hz: float) -> list[str]:
    """Build the argument list of the radio's program; its samples go to stdout.

    Raises
    ------
    ConfigError
        A setting that this radio does not have.
    """
    program = PROGRAMS[_known(settings.kind)]
    gain = program.default_gain if settings.gain is None else settings.gain
    lowest, highest = program.gains
    if not lowest <= gain <= highest:
        raise ConfigError(
            f"gain {gain} is not possible with {program.title}",
            remedy=f"Set [radio] gain between {lowest} and {highest}",
        )
    slowest, fastest = program.rates_hz
    # A stand-in (`program`) may offer any rate.
    if not settings.program and not slowest <= settings.sample_rate_hz <= fastest:
        raise ConfigError(
            f"{settings.sample_rate_hz:.0f} samples a second are not possible with "
            f"{program.title}",
            remedy=f"Set [radio] sample_rate_hz between {slowest:.0f} and {fastest:.0f}",
        )
    if not 1e6 <= center_frequency_hz <= 6e9:
        raise ConfigError(
            f"radio frequency {center_frequency_hz} Hz is not possible",
            remedy="Give it in hertz, e.g. 148.7e6",
        )
    arguments = _ARGUMENTS[settings.kind](settings, center_frequency_hz, gain)
    return [*(settings.program or (program.receive,)), *arguments]


def commands_before(settings: RadioSettings) -> list[list[str]]:
    """List what must be run before the radio's program: rtl_sdr cannot switch its bias-tee."""
    if settings.kind != "rtlsdr" or settings.program:
        return []
    device = ["-d", settings.serial] if settings.serial else []
    # Also to switch it off: it stays on from an earlier flight.
    return [["rtl_biast", *device, "-b", "1" if settings.bias_tee else "0"]]


def _airspy(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    return [
        # Samples to stdout (-r -), 16 bits on the wire (-p 0), complex float (-t 0).
        *("-r", "-", "-f", _megahertz(settings, frequency_hz)),
        *("-p", "0", "-a", _rate(settings), "-t", "0"),
        *("-h", str(gain), "-b", "1" if settings.bias_tee else "0"),
        *_serial("-s", settings),
    ]


def _airspyhf(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    if settings.bias_tee:
        raise ConfigError(
            "airspyhf_rx cannot switch a bias-tee", remedy="Set [radio] bias_tee = false"
        )
    return [
        # "-r stdout", not "-"; automatic gain off, for it would follow the pulses.
        *("-r", "stdout", "-f", _megahertz(settings, frequency_hz), "-a", _rate(settings)),
        *("-g", "off", "-m", "on", "-t", str(8 - gain)),
        *_serial("-s", settings),
    ]


def _rtlsdr(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    ppm = round(settings.frequency_correction_ppm)
    rest_ppm = settings.frequency_correction_ppm - ppm
    return [
        *("-f", str(round(frequency_hz / (1.0 + rest_ppm * 1e-6)))),
        *("-s", _rate(settings), "-g", str(gain), "-b", str(_rtl_block_bytes(settings))),
        # The library refuses to set the same correction twice, so 0 is left out.
        *(("-p", str(ppm)) if ppm else ()),
        *_serial("-d", settings),
        "-",
    ]


def _rtl_block_bytes(settings: RadioSettings) -> int:
    """Bytes that rtl_sdr writes at once: its 262 144 would be half a second at 250 kS/s.

    At most 44 ms: what is lost is seen by the arrivals of three writes.
    """
    size = 8192
    while size < 262_144 and 2 * size <= 2 * settings.sample_rate_hz * 0.0437:
        size *= 2
    return size


def _hackrf(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    lna = min(40, 8 * round(gain / 16))
    vga = min(62, 2 * ((gain - lna) // 2))
    return [
        *("-r", "-", "-f", str(round(_corrected(settings, frequency_hz)))),
        *("-s", _rate(settings), "-l", str(lna), "-g", str(vga), "-a", "0"),
        *("-p", "1" if settings.bias_tee else "0"),
        *_serial("-d", settings),
    ]


_ARGUMENTS = {
    "airspy": _airspy,
    "airspyhf": _airspyhf,
    "rtlsdr": _rtlsdr,
    "hackrf": _hackrf,
}


def _corrected(settings: RadioSettings, frequency_hz: float) -> float:
    """Ask for a little less of a crystal that is fast; these programs have no such option.

    (hackrf_transfer has ``-C``, but reads it as an unsigned number.)
    """
    return frequency_hz / (1.0 + settings.frequency_correction_ppm * 1e-6)


def _megahertz(settings: RadioSettings, frequency_hz: float) -> str:
    return f"{_corrected(settings, frequency_hz) / 1e6:.6f}"


def _rate(settings: RadioSettings) -> str:
    return str(round(settings.sample_rate_hz))


def _serial(option: str, settings: RadioSettings) -> tuple[str, ...]:
    return (option, settings.serial) if settings.serial else ()


def _known(kind: str) -> str:
    if kind in PROGRAMS:
        return kind
    raise ConfigError(
        f"unknown radio {kind!r}",
        remedy=f"Set [radio] kind to one of {', '.join(PROGRAMS)}, soapy",
    )


_ABSENT = (
    "_ERROR_NOT_FOUND",
    "No supported devices",
    "No devices attached",
    "No HackRF boards",
    "HackRF not found",
    "airspyhf_open() failed",
    "No matching devices",
)
_FORBIDDEN = ("usb_open error -3", "LIBUSB_ERROR_ACCESS", "Access denied", "Permission denied")
_BUSY = ("usb_claim_interface error -6", "LIBUSB_ERROR_BUSY", "_ERROR_BUSY", "Resource busy")


def says_absent(text: str) -> bool:
    """Whether a radio program's words mean that there is no device."""
    return any(words in text for words in _ABSENT)


def exit_error(title: str, package: str, code: int, said: str, last_lines: str) -> RadioError:
    """Turn the end of a radio's program into an error that names the remedy.

    Parameters
    ----------
    title, package : str
        The radio, and the Debian package of its program.
    code : int
        Exit status; negative for a signal.
    said : str
        The status in words.
    last_lines : str
        What it wrote to stderr last.
    """
    message = f"{title}: the radio's program {said}"
    if last_lines:
        message += f": {last_lines}"
    if any(words in last_lines for words in _FORBIDDEN):
        return RadioMissing(
            message,
            remedy=f"Plug the radio in again (the package {package} has installed a rule that "
            "lets users open it), or add the user to the group plugdev",
        )
    if any(words in last_lines for words in _BUSY):
        return RadioMissing(message, remedy="Close the other program that uses the radio")
    if says_absent(last_lines):
        return RadioMissing(message, remedy="Plug the radio in, or try another cable or port")
    remedy = (
        "It runs out of memory or was killed by somebody"
        if code == -9
        else "Check the radio's cable and power; it is started again by itself in flight"
    )
    return RadioStopped(message, remedy=remedy)
