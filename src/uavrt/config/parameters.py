"""Table of the settings that a ground station may change as MAVLink parameters, one row each.

The drone's answers, the supervisor's checks, the file of stored values, the metadata for ground
stations and the manual are all derived from this table. PARAM_VALUE limits names to 16
characters; ground stations group parameters by the part of the name before the first
underscore.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from uavrt.config.radios import RADIOS
from uavrt.config.settings import OperatingModeName, RadioSettings, Settings
from uavrt.core.errors import ConfigError
from uavrt.core.messages import Tag

Kind = Literal["whole", "real", "switch", "choice"]

SIGNIFICANT_DIGITS = 7
"""Number of decimal digits to which parameters are rounded, because MAVLink sends them as
float32; 0.005 is then shown as 0.005."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter: its setting, range, unit and description."""

    name: str
    table: str
    field: str
    kind: Kind
    short: str
    meaning: str
    low: float = 0
    high: float = 1
    default: float = 0
    unit: str = ""
    decimals: int = 0
    choices: tuple[str, ...] = ()
    """Names of the values 0, 1, … of a choice; empty for a numeric parameter."""
    absent: float | None = None
    """Value outside `low` to `high` that means "not set"; None if a value is required."""
    scale: float = 1.0
    """Factor that converts the parameter's value to that of the setting."""
    live: bool = False
    """True if a change applies at once; False if from the next start of detection."""
    volatile: bool = False
    """True for a state that changes during operation, such as `DET_RUN`, and is therefore not
    stored as a setting."""

    def allows(self, value: float) -> bool:
        """True if a value is within the parameter's range."""
        if value == self.absent:
            return True
        whole = self.kind == "real" or value == int(value)
        return whole and self.low <= value <= self.high


PARAMETERS: dict[str, Parameter] = {
    parameter.name: parameter
    for parameter in (
        Parameter(
            name="RADIO_GAIN",
            table="radio",
            field="gain",
            kind="whole",
            high=120,
            default=-1,
            absent=-1,
            live=True,
            short="Receiver gain",
            meaning="In the radio's own steps (Airspy 0 to 21); -1: the radio's usual gain.",
        ),
        Parameter(
            name="RADIO_BIAS_TEE",
            table="radio",
            field="bias_tee",
            kind="switch",
            live=True,
            short="Power for an amplifier",
            meaning="Power an amplifier at the antenna through the cable.",
        ),
        Parameter(
            name="RADIO_FREQ_KHZ",
            table="radio",
            field="center_frequency_hz",
            kind="whole",
            low=20_000,
            high=1_000_000,
            absent=0,
            # Whole kilohertz: a float32 holds no single hertz at 150 MHz.
            scale=1e3,
            unit="kHz",
            short="Radio frequency",
            meaning="Middle of the received band; 0: the tuner chooses it from the tags.",
        ),
        Parameter(
            name="RADIO_PPM",
            table="radio",
            field="frequency_correction_ppm",
            kind="real",
            low=-200,
            high=200,
            decimals=2,
            unit="ppm",
            live=True,
            short="Crystal error",
            meaning="Known error of the radio's crystal, positive when it runs fast.",
        ),
        Parameter(
            name="DET_K",
            table="detection",
            field="k",
            kind="whole",
            high=100,
            short="Pulses for a decision",
            meaning="Pulses summed for one decision, for all tags; 0: as in each tag's entry.",
        ),
        Parameter(
            name="DET_FALSE_ALARM",
            table="detection",
            field="false_alarm_probability",
            kind="real",
            high=0.5,
            decimals=4,
            short="False-alarm probability",
            meaning="For one decision interval, for all tags; 0: as in each tag's entry.",
        ),
        Parameter(
            name="DET_WINDOW_HZ",
            table="detection",
            field="frequency_window_hz",
            kind="real",
            low=10,
            high=2_000,
            default=500,
            unit="Hz",
            short="Half-width of the search",
            meaning="Half-width of the search around each tag's frequency.",
        ),
        Parameter(
            name="DET_MODE",
            table="detection",
            field="operating_mode",
            kind="choice",
            choices=get_args(OperatingModeName),
            high=len(get_args(OperatingModeName)) - 1,
            short="Operating mode",
            meaning="Frequency search after a detection; the names are those of the original's"
            " detectorConfig.txt.",
        ),
        Parameter(
            name="POSE_HEADING",
            table="pose",
            field="heading_deg",
            kind="real",
            low=-360,
            high=360,
            default=-1000,
            absent=-1000,
            decimals=1,
            unit="deg",
            live=True,
            short="Heading of a station",
            meaning="Direction of a station without autopilot, clockwise from true north;"
            " -1000: from its compass.",
        ),
        Parameter(
            name="REC_IQ",
            table="recording",
            field="iq",
            kind="switch",
            short="Record the band",
            meaning="Also record the decimated band while detecting, 5.4 GB an hour.",
        ),
        Parameter(
            name="REC_CAPTURE_S",
            table="recording",
            field="capture_s",
            kind="real",
            low=0.1,
            high=3600,
            default=8,
            decimals=1,
            unit="s",
            short="Length of a raw capture",
            meaning="How long the band is recorded on command, unless it is stopped.",
        ),
    )
}


RUN = Parameter(
    name="DET_RUN",
    table="",
    field="",
    kind="switch",
    live=True,
    volatile=True,
    short="Detect",
    meaning="1 starts detection with the last tags, 0 stops it; shows which of the two it is.",
)
"""Parameter that starts and stops detection, for ground stations without uavrt's commands."""

OFFERED: dict[str, Parameter] = {**PARAMETERS, RUN.name: RUN}
"""All parameters offered to a ground station: those of settings, and `RUN`."""


def run_wanted(value: float) -> bool:
    """True if a value of `DET_RUN` starts detection; raises `ConfigError` if not 0 or 1."""
    if not (math.isfinite(value) and RUN.allows(value)):
        raise ConfigError(f"{RUN.name} cannot be {value:g}: 1 starts detection, 0 stops it")
    return bool(value)


def parameter_values(settings: Settings) -> dict[str, float]:
    """Return the values of all parameters by name, in the order of the table."""
    return {name: _value(settings, parameter) for name, parameter in PARAMETERS.items()}


def with_parameter(settings: Settings, name: str, value: float) -> Settings:
    """Return the settings with one parameter changed. Raises `ConfigError`, which states the
    allowed range.
    """
    parameter = PARAMETERS.get(name)
    if parameter is None:
        raise ConfigError(
            f"there is no parameter {name}; known parameters are {', '.join(PARAMETERS)}"
        )
    if name == "RADIO_GAIN":
        gains = RADIOS.get(settings.radio.kind, RADIOS["soapy"]).gains
        parameter = replace(parameter, low=gains[0], high=gains[1])
    if not (math.isfinite(value) and parameter.allows(value)):
        low, high = parameter.low, parameter.high
        whole = "" if parameter.kind == "real" else "whole, "
        absent = "" if parameter.absent is None else f", or {parameter.absent:g}"
        raise ConfigError(f"{name} cannot be {value:g}: {whole}{low:g} to {high:g}{absent}")
    table = replace(
        getattr(settings, parameter.table), **{parameter.field: _setting(parameter, value)}
    )
    return replace(settings, **{parameter.table: table})


def check_start(
    settings: Settings | None, center_frequency_hz: float | None, gain: float | None
) -> int | None:
    """Check the frequency and gain of a start or capture command; return the gain, or None if
    the command has none. Raises `ConfigError` for an unsupported value.
    """
    if center_frequency_hz is not None:
        row = PARAMETERS["RADIO_FREQ_KHZ"]
        if not row.low <= center_frequency_hz / row.scale <= row.high:
            raise ConfigError(
                f"the radio frequency {center_frequency_hz / 1e6:.10g} MHz is not supported: "
                f"choose {row.low / 1e3:g} to {row.high / 1e3:g} MHz"
            )
    if gain is None:
        return None
    settings = settings or Settings(radio=RadioSettings(kind="soapy"))
    return with_parameter(settings, "RADIO_GAIN", gain).radio.gain


def tuned_frequency(radio: RadioSettings, frequency_hz: float) -> float:
    """Return the frequency that the radio actually tunes to [Hz]. Raises `ConfigError` if the
    radio cannot receive it.
    """
    row = RADIOS.get(radio.kind)
    if row is None:
        return frequency_hz
    if not row.receives(frequency_hz):
        raise ConfigError(
            f"{row.title} does not receive {frequency_hz * 1e-06:.6g} MHz",
            remedy=f"Choose a frequency within {row.receives_text()}",
        )
    return row.tuned_hz(frequency_hz, radio.frequency_correction_ppm)


def warnings_of_band(
    tags: Sequence[Tag], center_hz: float, sample_rate_hz: float
) -> tuple[str, ...]:
    """Return warnings about tags outside the received band. Raises `ConfigError` if all tags
    are outside.
    """
    half_hz = sample_rate_hz / 2.0
    beyond = [str(tag.tag_id) for tag in tags if abs(tag.frequency_hz - center_hz) > half_hz]
    if not beyond:
        return ()
    band = f"{(center_hz - half_hz) / 1e6:.10g} to {(center_hz + half_hz) / 1e6:.10g} MHz"
    if len(beyond) == len(tags):
        raise ConfigError(
            f"no tag is in the band received at {center_hz / 1e6:.10g} MHz "
            f"({band}): choose another frequency"
        )
    return (f"Not received ({band}): tags {', '.join(beyond[:10])}",)


def tags_with_overrides(settings: Settings, tags: Iterable[Tag]) -> tuple[Tag, ...]:
    """Return the tags with `k` and `false_alarm_probability` replaced where the settings give
    one value for all tags.
    """
    detection = settings.detection
    changes: dict[str, Any] = {}
    if detection.k:
        changes["k"] = detection.k
    if detection.false_alarm_probability:
        changes["false_alarm_probability"] = detection.false_alarm_probability
    return tuple(replace(tag, **changes) for tag in tags)


def _value(settings: Settings, parameter: Parameter) -> float:
    setting = getattr(getattr(settings, parameter.table), parameter.field)
    if setting is None:
        assert parameter.absent is not None
        return parameter.absent
    if parameter.kind == "choice":
        return float(parameter.choices.index(setting))
    number = float(setting) / parameter.scale
    return number if parameter.kind == "real" else float(round(number))


def _setting(parameter: Parameter, value: float) -> float | int | bool | str | None:
    if value == parameter.absent:
        return None
    match parameter.kind:
        case "switch":
            return bool(value)
        case "choice":
            return parameter.choices[int(value)]
        case "whole" if parameter.scale == 1.0:
            return int(value)
        case "whole":
            return value * parameter.scale
        case "real":
            return float(f"{value:.{SIGNIFICANT_DIGITS}g}")
