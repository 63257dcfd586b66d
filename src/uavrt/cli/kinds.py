"""Value types of command-line options, with their limits.

Each number on the command line has one of these types: "not a number" and infinity pass the
comparisons of most validators, and would fail far from the command line.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Parameter


@dataclass(frozen=True, slots=True)
class Between:
    """A validator: the number is finite and within limits.

    `least`, `most`: smallest and largest allowed value.
    `above`: the value is larger than this.
    `unit`: for the message.
    """

    least: float | None = None
    most: float | None = None
    above: float | None = None
    unit: str = ""

    def __call__(self, _kind: Any, value: Any) -> None:
        """Raise ValueError with the limits if `value`, or one of several, is outside."""
        for one in value if isinstance(value, list | tuple) else (value,):
            if one is None:
                continue
            if not (
                math.isfinite(one)
                and (self.least is None or one >= self.least)
                and (self.most is None or one <= self.most)
                and (self.above is None or one > self.above)
            ):
                raise ValueError(f"It must be {self}.")

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
"""TCP or UDP port; 0 takes any free one."""
Component = Annotated[int, Parameter(validator=Between(least=1, most=255))]
Vehicles = tuple[Annotated[int, Parameter(validator=Between(least=1, most=255))], ...]
Seed = Annotated[int, Parameter(validator=Between(least=0))]
Count = Annotated[int, Parameter(validator=Between(least=1))]
"""A number of things, at least one."""
Counts = tuple[Count, ...]
GroupPulses = Annotated[int, Parameter(validator=Between(least=1, most=100))]
"""K, as in tag files: the detector's thresholds for longer groups are unknown."""
Tally = Annotated[int, Parameter(validator=Between(least=0))]
"""A number of things, possibly zero."""
Seconds = Annotated[float, Parameter(validator=Between(above=0, unit="s"))]
SecondsApart = Annotated[float, Parameter(validator=Between(least=-1e9, most=1e9, unit="s"))]
"""Difference of two clocks, at most thirty years, since unset clocks begin in 1970."""
Minutes = Annotated[float, Parameter(validator=Between(above=0, unit="min"))]
Hertz = Annotated[float, Parameter(validator=Between(above=0, unit="Hz"))]
TagFrequency = Annotated[float, Parameter(validator=Between(least=20e6, most=1e9, unit="Hz"))]
"""Tag frequency, as in tag files: megahertz typed for hertz are rejected."""
PulseWidth = Annotated[float, Parameter(validator=Between(least=1e-3, most=1, unit="s"))]
"""Pulse width of a tag, as in tag files: milliseconds typed for seconds are rejected."""
Interval = Annotated[float, Parameter(validator=Between(above=0, most=60, unit="s"))]
"""Interval between pulses of a tag, as in tag files."""
HertzOrZero = Annotated[float, Parameter(validator=Between(least=0, unit="Hz"))]
"""A carrier frequency, or 0 for samples of which only the offset matters."""
Degrees = Annotated[float, Parameter(validator=Between(least=-360, most=360, unit="degrees"))]
DegreesOfError = Annotated[float, Parameter(validator=Between(least=0, unit="degrees"))]
Metres = Annotated[float, Parameter(validator=Between(above=0, most=20_000, unit="m"))]
Heights = tuple[
    Annotated[float, Parameter(validator=Between(above=0, most=20_000, unit="m"))], ...
]
Side = Annotated[float, Parameter(validator=Between(least=0.5, most=1000, unit="m"))]
Reach = Annotated[float, Parameter(validator=Between(least=0, most=100_000, unit="m"))]
"""Distance over ground, possibly zero."""
Speed = Annotated[float, Parameter(validator=Between(above=0, most=100, unit="m/s"))]
Power = Annotated[float, Parameter(validator=Between(least=-100, most=40, unit="dBm"))]
DecibelsOfError = Annotated[float, Parameter(validator=Between(least=0, most=40, unit="dB"))]
Decibels = Annotated[float, Parameter(validator=Between(least=-200, most=200, unit="dB"))]
NoiseFigure = Annotated[float, Parameter(validator=Between(least=0, most=60, unit="dB"))]
"""Noise over the thermal noise, not negative."""
MetresOfError = Annotated[float, Parameter(validator=Between(least=0, unit="m"))]
Factor = Annotated[float, Parameter(validator=Between(above=0))]
"""A ratio, such as that of simulated time to real time."""
TagIds = tuple[Annotated[int, Parameter(validator=Between(least=1, most=0xFFFF_FFFF))], ...]
"""Ids of tags; the tunnel has four bytes for one."""
Share = Annotated[float, Parameter(validator=Between(least=0, most=1))]
