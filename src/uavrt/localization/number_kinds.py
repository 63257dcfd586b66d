"""Kinds of numbers in the records of constants; a number without a kind is tuned.

A change of a tuned number by 30 % changes a result. `tests/unit/test_rules.py` limits how many
numbers are tuned.
"""

from typing import Annotated, TypeVar

T = TypeVar("T")

Guard = Annotated[T, "guard"]
"""Limit on input, work, age or range, or a numerical floor."""
Resolution = Annotated[T, "resolution"]
"""Step, size or candidates of a grid, table or integral; a finer one takes longer."""
Fixed = Annotated[T, "fixed"]
"""Definition, or part of a published method."""
