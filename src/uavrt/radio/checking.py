"""Check before a flight that the configured radio delivers samples."""

from contextlib import closing
from typing import Final

from uavrt.config.radios import RADIOS
from uavrt.config.settings import RadioSettings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import RadioAmbiguous, RadioStopped
from uavrt.radio.opening import open_radio
from uavrt.radio.receivers.devices import ambiguous_radios
from uavrt.radio.receivers.program_messages import stalled
from uavrt.radio.sanity import SampleCheck

_PATIENCE_S: Final = 4.0
_MOST_LOST: Final = 0.02
"""Fraction of lost samples above which the check of the radio reports a fault."""
_DURATION_S: Final = 2.8
"""Duration of the check [s], enough to measure the rate (`radio.timing.arrival_rate`)."""
_FREQUENCY_HZ: Final = 150e6
"""Frequency at which the radio is checked if the settings do not fix one [Hz]."""


def check_device(settings: RadioSettings) -> str:
    """Receive samples for three seconds and return a sentence with the measured result.

    Raises an error with a remedy if the radio does not work as configured.
    """
    if (several := ambiguous_radios(settings)) is not None:
        raise RadioAmbiguous(several[0], remedy=several[1])
    row = RADIOS.get(settings.kind)
    title = settings.kind if row is None else row.title
    check, end_s, received, lost = SampleCheck(title), float("inf"), 0, 0
    frequency_hz = settings.center_frequency_hz or _FREQUENCY_HZ
    with closing(open_radio(settings, frequency_hz, clock=Clock.start())) as source:
        begun_s = monotonic_s()
        while monotonic_s() < end_s:
            try:
                block = source.read(timeout_s=0.5)
            except EOFError:
                raise RadioStopped(
                    f"{title}: the samples have ended",
                    remedy="Restart the program that sends these samples",
                ) from None
            if block is not None:
                check.check(block)
                received += len(block.samples)
                lost += block.lost_before - block.unsure_before
                end_s = min(end_s, monotonic_s() + _DURATION_S)
            elif monotonic_s() > begun_s + _PATIENCE_S:
                raise stalled(title)
        if (fault := getattr(source, "rate_fault", None)) is not None:
            raise RadioStopped(fault)
        if lost > _MOST_LOST * (received + lost):
            raise RadioStopped(
                f"{title}: {100.0 * lost / (received + lost):.0f} % of the samples are lost",
                remedy="Check the radio's cable and this computer's load",
            )
    return f"{title}: {settings.sample_rate_hz:.0f} samples a second arrive"
