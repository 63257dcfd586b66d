"""The Airspy Mini and R2 by ``airspy_rx``."""

from uavrt.config import RadioSettings
from uavrt.radio.arguments import megahertz, rate, serial


def arguments(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    """List the program's arguments."""
    return [
        # Samples to stdout (-r -), 16 bits on the wire (-p 0), complex float (-t 0).
        *("-r", "-", "-f", megahertz(settings, frequency_hz)),
        *("-p", "0", "-a", rate(settings), "-t", "0"),
        *("-h", str(gain), "-b", "1" if settings.bias_tee else "0"),
        *serial("-s", settings),
    ]
