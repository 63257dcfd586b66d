"""One line of an experiment's table: what came out, how sure, and what was asked."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_RESAMPLES = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """A measured figure beside its bar and its bound."""

    experiment: str
    """B1, L2 …: docs/reference/localization-bars.md."""
    condition: str
    quantity: str
    """With its unit."""
    value: float
    interval95: tuple[float, float]
    """Of the value: Wilson's for a share, else by bootstrap over the runs."""
    runs: int
    least: float | None = None
    most: float | None = None
    """The bar."""
    bound: float | None = None
    """The best that any estimator could do, where it is known."""

    @property
    def passed(self) -> bool:
        """Whether the value keeps within the bar."""
        return (self.least is None or self.value >= self.least) and (
            self.most is None or self.value <= self.most
        )


def measured(
    experiment: str,
    condition: str,
    quantity: str,
    values: Sequence[float],
    figure: Callable[[NDArray[np.float64]], float],
    *,
    least: float | None = None,
    most: float | None = None,
    bound: float | None = None,
) -> Result:
    """Make a line of a figure over runs, with its 95 % interval.

    Parameters
    ----------
    experiment, condition, quantity : str
        What is measured.
    values : sequence of float
        One for each run.
    figure : callable
        Values to the figure: a median, a root of mean squares …
    least, most, bound : float, optional
        Bar and bound.
    """
    array = np.asarray(values, np.float64)
    low, high = _wilson(array) if figure is share else _bootstrap(array, figure)
    return Result(
        experiment=experiment,
        condition=condition,
        quantity=quantity,
        value=figure(array),
        interval95=(low, high),
        runs=len(array),
        least=least,
        most=most,
        bound=bound,
    )


def _bootstrap(
    values: NDArray[np.float64], figure: Callable[[NDArray[np.float64]], float]
) -> tuple[float, float]:
    rng = np.random.default_rng(len(values))
    again = [figure(rng.choice(values, len(values))) for _ in range(_RESAMPLES)]
    low, high = np.quantile(again, [0.025, 0.975])
    return float(low), float(high)


def _wilson(values: NDArray[np.float64]) -> tuple[float, float]:
    """Wilson 1927: right also for shares of 0 and 1, of which a bootstrap makes certainty."""
    count, p, z2 = len(values), share(values), 1.96**2
    middle = (p + z2 / (2 * count)) / (1 + z2 / count)
    half = np.sqrt(p * (1 - p) * z2 / count + z2**2 / (4 * count**2)) / (1 + z2 / count)
    return max(0.0, float(middle - half)), min(1.0, float(middle + half))


def rms(values: NDArray[np.float64]) -> float:
    """Root of the mean of squares."""
    return float(np.sqrt(np.mean(values**2)))


def median(values: NDArray[np.float64]) -> float:
    """Middle value."""
    return float(np.median(values))


def mean(values: NDArray[np.float64]) -> float:
    """Arithmetic mean."""
    return float(np.mean(values))


def tenth_worst(values: NDArray[np.float64]) -> float:
    """Value that a tenth of the runs exceed."""
    return float(np.quantile(values, 0.9))


def share(values: NDArray[np.float64]) -> float:
    """Share of runs that are true."""
    return float(np.mean(values))


COLUMNS = (
    *("experiment", "condition", "quantity", "value", "low", "high"),
    *("least", "most", "bound", "runs", "passed"),
)
"""Names of `cells`."""


def cells(one: Result) -> tuple[str | float | None, ...]:
    """One line for a CSV file; what is not known is empty."""
    return (
        *(one.experiment, one.condition, one.quantity, one.value, *one.interval95),
        *(one.least, one.most, one.bound, one.runs, one.passed),
    )


def table(results: Sequence[Result]) -> str:
    """Draw results as a table of plain text."""
    rows = [("", "condition", "quantity", "value", "95 %", "bar", "bound", "runs", "")]
    rows += [
        (
            one.experiment,
            one.condition,
            one.quantity,
            f"{one.value:.3g}",
            f"{one.interval95[0]:.3g} – {one.interval95[1]:.3g}",
            _bar(one),
            "" if one.bound is None else f"{one.bound:.3g}",
            str(one.runs),
            "" if one.least is None and one.most is None else "ok" if one.passed else "MISSED",
        )
        for one in results
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def _bar(one: Result) -> str:
    if one.least is not None and one.most is not None:
        return f"{one.least:g} – {one.most:g}"
    if one.most is not None:
        return f"≤ {one.most:g}"
    return "" if one.least is None else f"≥ {one.least:g}"
