"""Refuse tags that cannot be searched for, with an error that contains a remedy."""

import math

from uavrt.core.errors import ConfigError
from uavrt.core.messages import Tag
from uavrt.dsp.plan import widest_window_hz


def check_searchable(tag: Tag, rate_hz: float, center_hz: float, window_hz: float) -> None:
    """Raise `ConfigError` for a tag that cannot be searched in ± `window_hz`."""
    if not rate_hz > 0.0 or not math.isfinite(rate_hz):
        raise ConfigError(
            f"the sample rate of {rate_hz} Hz is not positive", remedy="Give a positive rate"
        )
    if not window_hz > 0.0:
        raise ConfigError(
            f"the frequency window of {window_hz} Hz is not positive",
            remedy="Give a positive half-width",
        )
    if abs(tag.frequency_hz - center_hz) > rate_hz / 2.0:
        raise ConfigError(
            f"tag {tag.tag_id} at {tag.frequency_hz:.0f} Hz is not in the channel of "
            f"{rate_hz:.0f} Hz around {center_hz:.0f} Hz",
            remedy="Choose the channel that contains the tag",
        )
    widest_hz = widest_window_hz(tag.frequency_hz - center_hz, rate_hz)
    if math.isfinite(window_hz) and window_hz > widest_hz:
        raise ConfigError(
            f"a frequency window of {window_hz:g} Hz around tag {tag.tag_id} reaches "
            f"beyond the tag's channel, where {math.floor(widest_hz)} Hz is the "
            "widest possible",
            remedy="Use a narrower --frequency-window (frequency_window_hz, DET_WINDOW_HZ)",
        )
    if tag.k < 1 or not 0.0 < tag.false_alarm_probability < 1.0:
        raise ConfigError(
            f"tag {tag.tag_id}: k = {tag.k} or the false-alarm probability "
            f"{tag.false_alarm_probability} is out of range",
            remedy="Set k to 1 or more, and the false-alarm probability between 0 and 1",
        )
    if tag.pulse_width_s * rate_hz < 4.0:
        raise ConfigError(
            f"a pulse of {tag.pulse_width_s} s is shorter than 4 samples",
            remedy="Use a higher sample rate of the channels",
        )
    if min(tag.pulse_intervals_s) - tag.interval_uncertainty_s <= 2.0 * tag.pulse_width_s:
        raise ConfigError(
            f"tag {tag.tag_id} has an interval shorter than two pulses",
            remedy="Correct its interval, uncertainty or pulse width",
        )
