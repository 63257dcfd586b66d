"""Build the command lines of radio programs; `uavrt.config.radios` is the table of radios.

The programs run as separate processes; uavrt is not linked to their libraries.
"""

from collections.abc import Callable

from uavrt.config.parameters import tuned_frequency
from uavrt.config.radios import RADIOS, RadioRow
from uavrt.config.settings import RadioSettings
from uavrt.core.errors import ConfigError

PROGRAMS: dict[str, RadioRow] = {kind: row for kind, row in RADIOS.items() if row.receive}
"""Radios that have their own program for reading samples, by kind of radio."""


def receive_command(settings: RadioSettings, center_frequency_hz: float) -> list[str]:
    """Command line of the program that writes the radio's samples to stdout.

    Raises `ConfigError` for a setting that the radio does not support.
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
            f"{program.title}: {settings.sample_rate_hz:.0f} samples a second are not "
            "supported",
            remedy=f"Set [radio] sample_rate_hz to {program.rates_text()}",
        )
    tuned_frequency(settings, center_frequency_hz)
    arguments = ARGUMENTS[settings.kind](settings, center_frequency_hz, gain)
    return [*(settings.program or (program.receive,)), *arguments]


def commands_before(settings: RadioSettings) -> list[list[str]]:
    """Commands to run before the radio's program; empty for most radios.

    An RTL-SDR needs rtl_biast to switch its bias tee, because rtl_sdr has no option for this.
    """
    if settings.program or settings.kind != "rtlsdr":
        return []
    # Set in any case: the bias tee stays on from an earlier flight.
    bias = "1" if settings.bias_tee else "0"
    return [["rtl_biast", *_serial("-d", settings), "-b", bias]]


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
        # "-r stdout", not "-"; automatic gain off, because it would follow the pulses.
        *("-r", "stdout", "-f", _megahertz(settings, frequency_hz), "-a", _rate(settings)),
        *("-g", "off", "-m", "on", "-t", str(8 - gain)),
        *_serial("-s", settings),
    ]


def _rtlsdr(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    ppm = round(settings.frequency_correction_ppm)
    rest_ppm = settings.frequency_correction_ppm - ppm
    # rtl_sdr's default of 262 144 bytes per write is half a second at 250 kS/s. At most 44 ms:
    # the arrival times of three writes show a loss.
    block_bytes = 8192
    while block_bytes < 262_144 and block_bytes <= settings.sample_rate_hz * 0.0437:
        block_bytes *= 2
    return [
        *("-f", str(round(frequency_hz / (1.0 + rest_ppm * 1e-6)))),
        *("-s", _rate(settings), "-g", str(gain), "-b", str(block_bytes)),
        # The library refuses to set the same correction twice, so 0 is left out.
        *(("-p", str(ppm)) if ppm else ()),
        *_serial("-d", settings),
        "-",
    ]


def _hackrf(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    """Arguments of hackrf_transfer; the gain is divided between the radio's two amplifiers."""
    lna = min(40, 8 * round(gain / 16))
    vga = min(62, 2 * ((gain - lna) // 2))
    return [
        *("-r", "-", "-f", str(round(_corrected(settings, frequency_hz)))),
        *("-s", _rate(settings), "-l", str(lna), "-g", str(vga), "-a", "0"),
        *("-p", "1" if settings.bias_tee else "0"),
        *_serial("-d", settings),
    ]


ARGUMENTS: dict[str, Callable[[RadioSettings, float, int], list[str]]] = {
    "airspy": _airspy,
    "airspyhf": _airspyhf,
    "rtlsdr": _rtlsdr,
    "hackrf": _hackrf,
}


def _corrected(settings: RadioSettings, frequency_hz: float) -> float:
    """Frequency to request [Hz], so that a radio with a wrong clock is tuned correctly.

    Most radio programs have no option for a clock error. hackrf_transfer has ``-C``, but it
    reads the value as unsigned.
    """
    return frequency_hz / (1.0 + settings.frequency_correction_ppm * 1e-6)


def _megahertz(settings: RadioSettings, frequency_hz: float) -> str:
    return f"{_corrected(settings, frequency_hz) / 1e6:.6f}"


def _rate(settings: RadioSettings) -> str:
    return str(round(settings.sample_rate_hz))


def _serial(option: str, settings: RadioSettings) -> tuple[str, ...]:
    if not settings.serial:
        return ()
    prefix = RADIOS[settings.kind].serial_prefix
    return (option, prefix + settings.serial.removeprefix(prefix))


def _known(kind: str) -> str:
    if kind in PROGRAMS:
        return kind
    raise ConfigError(
        f"unknown radio {kind!r}", remedy=f"Set [radio] kind to one of {', '.join(RADIOS)}"
    )
