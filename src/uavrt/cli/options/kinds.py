"""Types of command-line options, with their limits.

Every number on the command line has one of these types. "Not a number" and infinity would pass
the comparisons of most validators, and fail far from the command line.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Parameter


@dataclass(frozen=True, slots=True)
class Between:
    """Check for option values: finite numbers within limits, greater than `above`."""

    least: float | None = None
    most: float | None = None
    above: float | None = None
    unit: str = ""

    def __call__(self, _kind: Any, value: Any) -> None:
        """Raise ValueError with the limits if a value, or one of several, is outside."""
        for one in value if isinstance(value, list | tuple) else (value,):
            if one is None:
                continue
            if not (
                math.isfinite(one)
                and (self.least is None or one >= self.least)
                and (self.most is None or one <= self.most)
                and (self.above is None or one > self.above)
            ):
                raise ValueError(f"The value must be {self}.")

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        limits = []
        if self.least is not None:
            limits.append(f"at least {self.least:,g}{unit}")
        if self.above is not None:
            limits.append(f"above {self.above:,g}{unit}")
        if self.most is not None:
            limits.append(f"at most {self.most:,g}{unit}")
        return " and ".join(limits)


Port = Annotated[int, Parameter(validator=Between(least=0, most=65_535))]
"""Type of an option for a TCP or UDP port; 0 takes any free one."""
Component = Annotated[int, Parameter(validator=Between(least=1, most=255))]
Vehicle = Annotated[int, Parameter(validator=Between(least=1, most=255))]
"""Type of an option for the MAVLink system id of a vehicle."""
Vehicles = tuple[Vehicle, ...]
Seed = Annotated[int, Parameter(validator=Between(least=0))]
Count = Annotated[int, Parameter(validator=Between(least=1))]
"""Type of an option for a whole number of at least 1."""
Counts = tuple[Count, ...]
GroupPulses = Annotated[int, Parameter(validator=Between(least=1, most=100))]
"""Type of an option for the number of pulses that are summed for one decision (K). The limits
are those of tag files; the detector has no thresholds for longer groups."""
Tally = Annotated[int, Parameter(validator=Between(least=0))]
"""Type of an option for a whole number of at least 0."""
Seconds = Annotated[float, Parameter(validator=Between(above=0, unit="s"))]
SecondsApart = Annotated[float, Parameter(validator=Between(least=-1e9, most=1e9, unit="s"))]
"""Type of an option for a clock difference [s], at most 1e9, because an unset clock begins in
1970."""
Minutes = Annotated[float, Parameter(validator=Between(above=0, unit="min"))]
Hertz = Annotated[float, Parameter(validator=Between(above=0, unit="Hz"))]
TagFrequency = Annotated[float, Parameter(validator=Between(least=20e6, most=1e9, unit="Hz"))]
"""Type of an option for a tag's frequency [Hz], with the limits of tag files; a value typed in
megahertz is rejected."""
PulseWidth = Annotated[float, Parameter(validator=Between(least=1e-3, most=1, unit="s"))]
"""Type of an option for a pulse width [s], with the limits of tag files; a value typed in
milliseconds is rejected."""
Interval = Annotated[float, Parameter(validator=Between(above=0, most=60, unit="s"))]
"""Type of an option for the interval between a tag's pulses [s], as limited in tag files."""
HertzOrZero = Annotated[float, Parameter(validator=Between(least=0, unit="Hz"))]
"""Type of an option for a carrier frequency [Hz]; 0 for samples with an unknown carrier."""
Degrees = Annotated[float, Parameter(validator=Between(least=-360, most=360, unit="degrees"))]
DegreesOfError = Annotated[float, Parameter(validator=Between(least=0, unit="degrees"))]
Metres = Annotated[float, Parameter(validator=Between(above=0, most=20_000, unit="m"))]
Heights = tuple[
    Annotated[float, Parameter(validator=Between(above=0, most=20_000, unit="m"))], ...
]
Side = Annotated[float, Parameter(validator=Between(least=0.5, most=1000, unit="m"))]
Reach = Annotated[float, Parameter(validator=Between(least=0, most=100_000, unit="m"))]
"""Type of an option for a distance over ground [m]; zero is allowed."""
Speed = Annotated[float, Parameter(validator=Between(above=0, most=100, unit="m/s"))]
Power = Annotated[float, Parameter(validator=Between(least=-100, most=40, unit="dBm"))]
DecibelsOfError = Annotated[float, Parameter(validator=Between(least=0, most=40, unit="dB"))]
Decibels = Annotated[float, Parameter(validator=Between(least=-200, most=200, unit="dB"))]
NoiseFigure = Annotated[float, Parameter(validator=Between(least=0, most=60, unit="dB"))]
"""Type of an option for the receiver's noise above the thermal noise [dB]; zero is allowed."""
MetresOfError = Annotated[float, Parameter(validator=Between(least=0, unit="m"))]
TagIds = tuple[Annotated[int, Parameter(validator=Between(least=1, most=0xFFFF_FFFF))], ...]
"""Type of an option for tag ids, which have four bytes in the radio protocol."""
Share = Annotated[float, Parameter(validator=Between(least=0, most=1))]
