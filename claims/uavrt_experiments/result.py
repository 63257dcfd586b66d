"""One line of an experiment's table: figure, interval, bar and bounds."""

import math
from dataclasses import dataclass
from typing import Any

from uavrt_experiments.statistics import Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A measured figure with its required range (bar), the original's figure and theoretical
    bounds.
    """

    experiment: str
    """Name of the experiment: E1, B2, L3 …"""
    quantity: str
    """Name of the quantity, with its unit."""
    case: str
    figure: float
    low: float
    """Lower end of the 95 % interval."""
    high: float
    n: int
    """Number of decisions, decision intervals, pulses or streams behind the figure."""
    least: float | None = None
    most: float | None = None
    """Largest allowed figure; with `least` it is the bar."""
    original: float | None = None
    """The original's figure, measured on its own program."""
    genie: float | None = None
    """Bound if time, frequency and interval are known."""
    union: float | None = None
    """Bound of perfectly aligned pulses, searched over the whole volume."""
    single: float | None = None
    """Bound of an energy detector of single pulses."""
    bound: float | None = None
    """Bound of any estimator, if it is known."""
    at: float | None = None
    """Place of the figure on the horizontal axis of its plot: ENR in dB, nominal
    share, or K."""
    note: str = ""
    shown: bool = True
    """False: too few measurements to confirm that the bar is met, and none against it; `note`
    gives the reason."""

    @classmethod
    def with_interval(
        cls, experiment: str, quantity: str, case: str, measured: Interval, n: int, **more: Any
    ) -> "Row":
        """Make the row of a figure with its 95 % interval."""
        figure, low, high = measured
        more |= {"experiment": experiment, "quantity": quantity, "case": case, "n": n}
        return cls(figure=figure, low=low, high=high, **more)

    @classmethod
    def counted(
        cls, experiment: str, quantity: str, case: str, figure: float, n: int = 1, **more: Any
    ) -> "Row":
        """Make the row of a figure that was counted or timed once: it has no interval."""
        return cls.with_interval(experiment, quantity, case, (figure,) * 3, n, **more)

    @property
    def exact(self) -> bool:
        """True if the figure has no interval."""
        return self.low == self.high == self.figure

    @property
    def barred(self) -> bool:
        """True if there is a bar."""
        return self.least is not None or self.most is not None

    @property
    def met(self) -> bool:
        """True if the figure itself meets the bar."""
        above = self.least is None or self.figure >= self.least - 1e-9
        return above and (self.most is None or self.figure <= self.most + 1e-9)

    @property
    def contradicted(self) -> bool:
        """True if the whole 95 % interval misses the bar.

        Also true if there was no data for the figure, such as no pulse although the bar
        requires some.
        """
        if self.barred and not self.met and (not self.n or not math.isfinite(self.figure)):
            return True
        below = self.least is not None and self.high < self.least
        return below or (self.most is not None and self.low > self.most)

    @property
    def sure(self) -> bool:
        """True if the whole 95 % interval meets the bar."""
        above = self.least is None or self.low >= self.least
        return above and (self.most is None or self.high <= self.most)

    @property
    def verdict(self) -> str:
        """Verdict on the bar in words; empty without a bar."""
        if not self.barred:
            return ""
        if self.met and not self.shown:
            return "not shown"
        if self.met:
            exact = self.most == self.figure == 0.0
            return "met" if self.sure or exact else "met, within error"
        return "NOT met" if self.contradicted else "not met, within error"

    @property
    def bar(self) -> str:
        """The bar as text."""
        if self.least is not None and self.most is not None:
            return f"{self.least:g} … {self.most:g}"
        if self.least is not None:
            return f"≥ {self.least:.4g}"
        return "" if self.most is None else f"≤ {self.most:.4g}"
