"""Mark the kinds of numbers in the records of constants; a number without a mark counts as
tuned.

A change of a tuned number by 30 % changes a result. `tests/unit/test_rules.py` limits how many
numbers are tuned.
"""

from typing import Annotated, TypeVar

T = TypeVar("T")

Guard = Annotated[T, "guard"]
"""Mark for a limit on input, computing time, age or range, or for a numerical floor."""
Resolution = Annotated[T, "resolution"]
"""Mark for the step, size or candidates of a grid, table or integral; a finer one only takes
longer."""
Fixed = Annotated[T, "fixed"]
"""Mark for a definition, or for a part of a published method."""
