"""Kinds of values that several commands take, each with the numbers that make sense.

Every number on the command line is of one of these kinds: "not a number" and infinity pass the
comparisons of most validators, and then do harm far from where they were typed.
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
        """Raise ValueError that names the limits if `value`, or one of it, is outside."""
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
        """Write the limits in words, such as "a number above 0 s"."""
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
"""Of TCP or UDP; 0 takes any free one."""
Component = Annotated[int, Parameter(validator=Between(least=1, most=255))]
"""Of a MAVLink system."""
Vehicles = tuple[Annotated[int, Parameter(validator=Between(least=1, most=255))], ...]
"""Numbers of MAVLink systems."""
Seed = Annotated[int, Parameter(validator=Between(least=0))]
"""Of a random generator."""
Count = Annotated[int, Parameter(validator=Between(least=1))]
"""How many, at least one."""
Counts = tuple[Count, ...]
"""Several of them."""
GroupPulses = Annotated[int, Parameter(validator=Between(least=1, most=100))]
"""K, as tag files have it: of longer groups the detector's thresholds are not known."""
Tally = Annotated[int, Parameter(validator=Between(least=0))]
"""How many, perhaps none."""
Seconds = Annotated[float, Parameter(validator=Between(above=0, unit="s"))]
"""A duration."""
SecondsApart = Annotated[float, Parameter(validator=Between(least=-1e9, most=1e9, unit="s"))]
"""A difference of two clocks: at most thirty years: those never set begin in 1970."""
Minutes = Annotated[float, Parameter(validator=Between(above=0, unit="min"))]
"""A duration."""
Hertz = Annotated[float, Parameter(validator=Between(above=0, unit="Hz"))]
"""A rate, a width or a carrier frequency."""
TagFrequency = Annotated[float, Parameter(validator=Between(least=20e6, most=1e9, unit="Hz"))]
"""Of a tag, as tag files have it: megahertz typed for hertz are refused."""
PulseWidth = Annotated[float, Parameter(validator=Between(least=1e-3, most=1, unit="s"))]
"""Of a tag, as tag files have it: milliseconds typed for seconds are refused."""
Interval = Annotated[float, Parameter(validator=Between(above=0, most=60, unit="s"))]
"""Between pulses of a tag, as tag files have it."""
HertzOrZero = Annotated[float, Parameter(validator=Between(least=0, unit="Hz"))]
"""A carrier frequency, or 0 for samples of which only the offset matters."""
Degrees = Annotated[float, Parameter(validator=Between(least=-360, most=360, unit="degrees"))]
"""An angle of either sign."""
DegreesOfError = Annotated[float, Parameter(validator=Between(least=0, unit="degrees"))]
"""A standard deviation of an angle."""
Metres = Annotated[float, Parameter(validator=Between(above=0, most=20_000, unit="m"))]
"""A height over the ground or over the tags."""
Heights = tuple[
    Annotated[float, Parameter(validator=Between(above=0, most=20_000, unit="m"))], ...
]
"""Heights over the ground."""
Side = Annotated[float, Parameter(validator=Between(least=0.5, most=1000, unit="m"))]
"""Of a square of a map."""
Reach = Annotated[float, Parameter(validator=Between(least=0, most=100_000, unit="m"))]
"""A distance over the ground, perhaps none."""
Speed = Annotated[float, Parameter(validator=Between(above=0, most=100, unit="m/s"))]
"""Of a drone."""
Power = Annotated[float, Parameter(validator=Between(least=-100, most=40, unit="dBm"))]
"""That a tag radiates."""
DecibelsOfError = Annotated[float, Parameter(validator=Between(least=0, most=40, unit="dB"))]
"""A standard deviation of a level."""
Decibels = Annotated[float, Parameter(validator=Between(least=-200, most=200, unit="dB"))]
"""A gain, a loss or a level."""
NoiseFigure = Annotated[float, Parameter(validator=Between(least=0, most=60, unit="dB"))]
"""Noise over the thermal noise: never less than none."""
MetresOfError = Annotated[float, Parameter(validator=Between(least=0, unit="m"))]
"""A standard deviation of a height."""
Factor = Annotated[float, Parameter(validator=Between(above=0))]
"""A ratio, such as that of simulated time to real time."""
TagIds = tuple[Annotated[int, Parameter(validator=Between(least=1, most=0xFFFF_FFFF))], ...]
"""Ids of tags; the tunnel has four bytes for one."""
Share = Annotated[float, Parameter(validator=Between(least=0, most=1))]
"""Of a whole."""
