"""Kinds of numbers in the records of constants; a number of no kind is tuned.

A change of a tuned number by 30 % moves a result. `tests/unit/test_rules.py` counts them.
"""

from typing import Annotated, TypeVar

T = TypeVar("T")

Guard = Annotated[T, "guard"]
"""Limit on input, work, age or range, or a numerical floor."""
Resolution = Annotated[T, "resolution"]
"""Step, size or candidates of a grid, table or integral; a finer one takes longer."""
Fixed = Annotated[T, "fixed"]
"""Definition, or part of a published method."""
