"""What `uavrt fly` takes."""

from typing import Any

import pytest

from uavrt.cli.system.fly import fly
from uavrt.core.errors import ConfigError


@pytest.mark.parametrize(
    ("action", "numbers", "values", "reason"),
    [
        ("goto", (), {}, "goto needs a position"),
        ("goto", (47.1,), {}, "goto needs a position"),
        ("goto", (8.5, 147.1, 3.0), {}, "goto needs a position"),
        ("goto", (147.1, 8.5), {}, "is not a latitude"),
        ("goto", (float("nan"), 8.5), {}, "is not a latitude"),
        ("hold", (30.0,), {}, "hold accepts no numbers"),
        ("takeoff", (), {}, "takeoff needs one height"),
        ("takeoff", (30.0, 8.0), {}, "takeoff needs one height"),
        ("takeoff", (30.0,), {"height": 20.0}, "takeoff needs one height"),
    ],
)
def test_numbers_that_do_not_fit_are_refused_with_the_right_ones(
    action: Any, numbers: tuple[float, ...], values: dict[str, Any], reason: str
) -> None:
    with pytest.raises(ConfigError, match=reason) as refused:
        fly(action, *numbers, **values)
    assert refused.value.remedy
