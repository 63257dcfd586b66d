"""RTL-SDR dongles by ``rtl_sdr``."""

from uavrt.config import RadioSettings
from uavrt.radio.arguments import rate, serial


def arguments(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    """List the program's arguments."""
    ppm = round(settings.frequency_correction_ppm)
    rest_ppm = settings.frequency_correction_ppm - ppm
    return [
        *("-f", str(round(frequency_hz / (1.0 + rest_ppm * 1e-6)))),
        *("-s", rate(settings), "-g", str(gain), "-b", str(_block_bytes(settings))),
        # The library refuses to set the same correction twice, so 0 is left out.
        *(("-p", str(ppm)) if ppm else ()),
        *serial("-d", settings),
        "-",
    ]


def commands_before(settings: RadioSettings) -> list[list[str]]:
    """List what must be run before: rtl_sdr cannot switch its bias-tee."""
    device = ["-d", settings.serial] if settings.serial else []
    # Also to switch it off: it stays on from an earlier flight.
    return [["rtl_biast", *device, "-b", "1" if settings.bias_tee else "0"]]


def _block_bytes(settings: RadioSettings) -> int:
    """Bytes that rtl_sdr writes at once: its 262 144 would be half a second at 250 kS/s.

    At most 44 ms: what is lost is seen by the arrivals of three writes.
    """
    size = 8192
    while size < 262_144 and 2 * size <= 2 * settings.sample_rate_hz * 0.0437:
        size *= 2
    return size
