"""Base class of all records of a scenario file."""

from typing import Any, ClassVar


class ScenarioRecord:
    """Base class of the scenario's tables; rejects unknown keys, infinities and NaN."""

    __slots__ = ()
    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "allow_inf_nan": False}
