"""What came out of many runs, with its interval, as rows of a table."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.experiments.result import Row
from uavrt.experiments.statistics import bootstrap_interval, wilson_interval


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
) -> Row:
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
    low, high = (
        # Right also for shares of 0 and 1, of which a bootstrap makes certainty.
        wilson_interval(int(array.sum()), len(array))
        if figure is share
        else bootstrap_interval(array, figure)
    )
    return Row(
        experiment=experiment,
        case=condition,
        quantity=quantity,
        figure=figure(array),
        low=low,
        high=high,
        n=len(array),
        least=least,
        most=most,
        bound=bound,
    )


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


def cells(one: Row) -> tuple[str | float | None, ...]:
    """One line for a CSV file; what is not known is empty."""
    return (
        *(one.experiment, one.case, one.quantity, one.figure, one.low, one.high),
        *(one.least, one.most, one.bound, one.n, one.met),
    )


def table(rows: Sequence[Row]) -> str:
    """Draw rows as a table of plain text."""
    lines = [("", "condition", "quantity", "value", "95 %", "bar", "bound", "runs", "")]
    lines += [
        (
            *(one.experiment, one.case, one.quantity, f"{one.figure:.3g}"),
            *(f"{one.low:.3g} – {one.high:.3g}", one.bar),
            "" if one.bound is None else f"{one.bound:.3g}",
            str(one.n),
            "" if not one.barred else "ok" if one.met else "MISSED",
        )
        for one in rows
    ]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )
