"""Base of all records of a scenario file."""

from typing import Any, ClassVar


class ScenarioRecord:
    """Base of the scenario's tables: unknown keys, infinities and NaN are faults."""

    __slots__ = ()
    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "allow_inf_nan": False}
