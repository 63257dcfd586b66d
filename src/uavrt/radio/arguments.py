"""What the arguments of several radios' programs have in common."""

from uavrt.config import RADIOS, RadioSettings


def corrected(settings: RadioSettings, frequency_hz: float) -> float:
    """Ask for a little less of a crystal that is fast; most programs have no such option.

    (hackrf_transfer has ``-C``, but reads it as an unsigned number.)
    """
    return frequency_hz / (1.0 + settings.frequency_correction_ppm * 1e-6)


def megahertz(settings: RadioSettings, frequency_hz: float) -> str:
    """Write the frequency to ask for."""
    return f"{corrected(settings, frequency_hz) / 1e6:.6f}"


def rate(settings: RadioSettings) -> str:
    """Write the sample rate."""
    return str(round(settings.sample_rate_hz))


def serial(option: str, settings: RadioSettings) -> tuple[str, ...]:
    """Choose one of several devices; Airspy's programs refuse a number without its prefix."""
    if not settings.serial:
        return ()
    prefix = RADIOS[settings.kind].serial_prefix
    return (option, prefix + settings.serial.removeprefix(prefix))
