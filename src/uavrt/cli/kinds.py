"""Kinds of values that several commands take."""

from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

Port = Annotated[int, Parameter(validator=Number(gte=0, lte=65_535))]
"""Of TCP or UDP; 0 takes any free one."""
Seed = Annotated[int, Parameter(validator=Number(gte=0))]
"""Of a random generator."""
