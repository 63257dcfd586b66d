"""The HackRF One by ``hackrf_transfer``."""

from uavrt.config import RadioSettings
from uavrt.radio.arguments import corrected, rate, serial


def arguments(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    """List the program's arguments; the gain is shared between LNA and VGA."""
    lna = min(40, 8 * round(gain / 16))
    vga = min(62, 2 * ((gain - lna) // 2))
    return [
        *("-r", "-", "-f", str(round(corrected(settings, frequency_hz)))),
        *("-s", rate(settings), "-l", str(lna), "-g", str(vga), "-a", "0"),
        *("-p", "1" if settings.bias_tee else "0"),
        *serial("-d", settings),
    ]
