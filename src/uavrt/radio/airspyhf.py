"""The Airspy HF+ by ``airspyhf_rx``."""

from uavrt.config import RadioSettings
from uavrt.errors import ConfigError
from uavrt.radio.arguments import megahertz, rate, serial


def arguments(settings: RadioSettings, frequency_hz: float, gain: int) -> list[str]:
    """List the program's arguments; raises `ConfigError` for what it cannot."""
    if settings.bias_tee:
        raise ConfigError(
            "airspyhf_rx cannot switch a bias-tee", remedy="Set [radio] bias_tee = false"
        )
    return [
        # "-r stdout", not "-"; automatic gain off, for it would follow the pulses.
        *("-r", "stdout", "-f", megahertz(settings, frequency_hz), "-a", rate(settings)),
        *("-g", "off", "-m", "on", "-t", str(8 - gain)),
        *serial("-s", settings),
    ]
