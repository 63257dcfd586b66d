"""One line of an experiment's table: what came out, how sure, what was asked and possible."""

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A measured figure with its bar, the original's figure and the bounds of theory."""

    experiment: str
    """E1, B2, L3 …"""
    quantity: str
    """With its unit."""
    case: str
    figure: float
    low: float
    """Lower end of the 95 % interval."""
    high: float
    n: int
    """Decisions, decision intervals, pulses or streams that the figure is made of."""
    least: float | None = None
    most: float | None = None
    """The bar."""
    original: float | None = None
    """What the original reached, measured on its own program."""
    genie: float | None = None
    """Bound: time, frequency and interval known beforehand."""
    union: float | None = None
    """Bound: perfectly aligned pulses, the whole volume searched."""
    single: float | None = None
    """Bound of an energy detector of single pulses."""
    bound: float | None = None
    """Bound: the best that any estimator could do, where it is known."""
    at: float | None = None
    """Where the figure lies on the axis of its plot: ENR in dB, nominal share, K."""
    note: str = ""
    shown: bool = True
    """False: too little was measured to show that the bar is kept, though nothing speaks
    against it; `note` says what it shows."""

    @classmethod
    def counted(
        cls, experiment: str, quantity: str, case: str, figure: float, n: int = 1, **more: Any
    ) -> "Row":
        """Make the row of a figure that was counted or timed once: it has no interval."""
        return cls(
            experiment=experiment,
            quantity=quantity,
            case=case,
            figure=figure,
            low=figure,
            high=figure,
            n=n,
            **more,
        )

    @property
    def exact(self) -> bool:
        """Whether the figure has no interval."""
        return self.low == self.high == self.figure

    @property
    def barred(self) -> bool:
        """Whether anything is asked of it."""
        return self.least is not None or self.most is not None

    @property
    def met(self) -> bool:
        """Whether the figure itself keeps within the bar."""
        above = self.least is None or self.figure >= self.least - 1e-9
        return above and (self.most is None or self.figure <= self.most + 1e-9)

    @property
    def contradicted(self) -> bool:
        """Whether the whole 95 % interval lies on the wrong side of the bar.

        So it does where there was nothing to make a figure of: none of what the bar asks for
        was heard.
        """
        if self.barred and not self.met and (not self.n or not math.isfinite(self.figure)):
            return True
        below = self.least is not None and self.high < self.least
        return below or (self.most is not None and self.low > self.most)

    @property
    def sure(self) -> bool:
        """Whether the whole 95 % interval keeps within the bar."""
        above = self.least is None or self.low >= self.least
        return above and (self.most is None or self.high <= self.most)

    @property
    def verdict(self) -> str:
        """In words; empty without a bar."""
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
