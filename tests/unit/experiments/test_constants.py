"""Constants of localization by kind, and the screening that changes them."""

from collections import Counter
from typing import Any

import pytest

from uavrt.core.errors import UsageError
from uavrt.localization import tuning
from uavrt_experiments.commands import constants as command
from uavrt_experiments.constants.changes import TUNED, change, constants, records_of, scaled
from uavrt_experiments.constants.report import kinds_line
from uavrt_experiments.constants.screening import Screened, chosen, effects, groups


def test_a_count_changes_by_at_least_one_and_a_tuple_in_all_its_numbers() -> None:
    assert scaled(2, 1.3) == 3
    assert scaled(10, 0.7) == 7
    assert scaled((1.0, 2), 0.7) == (0.7, 1)


def test_every_record_of_a_module_is_found() -> None:
    assert {"POWER_LAW", "LEVELS", "ACCEPTANCE", "FLIGHT", "RECEIVERS"} == {*records_of(tuning)}


def test_constants_are_counted_by_kind() -> None:
    kinds = constants()
    assert kinds["LEVELS.exponent"] == kinds["LOSS.hills.mean"] == TUNED
    assert kinds["POWER_LAW.least_density"] == kinds["LOSS.hills.limits"] == "guard"
    assert kinds["GRID.first_cells"] == "resolution"
    assert f"{Counter(kinds.values())[TUNED]} tuned" in kinds_line()
    grouped = [path for paths in groups().values() for path in paths]
    assert sorted(grouped) == sorted(path for path, kind in kinds.items() if kind == TUNED)


def test_groups_are_chosen_by_group_record_or_constant() -> None:
    assert chosen(["PATTERN"], singly=False)["PATTERN"] == groups()["PATTERN"]
    assert list(chosen(["LEVELS.exponent"], singly=False)) == ["LEVELS.exponent"]
    assert len(chosen(["PATTERN"], singly=True)) == len(groups()["PATTERN"])
    assert chosen(["PATERN"], singly=False) == {}


def test_differences_are_paired() -> None:
    before = {"turn": [{"error [°]": float(one), "held": 1.0} for one in range(1, 40)]}
    after = {"turn": [{"error [°]": 1.1 * one, "held": 1.0} for one in range(1, 40)]}
    error, held = effects(before, after, 1.3)
    assert error.clear
    assert error.size == pytest.approx(2.0)
    assert (held.clear, held.size, held.error) == (False, 0.0, 0.0)


def test_an_effect_within_its_error_does_not_matter() -> None:
    flat = {"turn": [{"held": float(one % 2)} for one in range(40)]}
    other = {"turn": [{"held": float(one % 2 or one == 0)} for one in range(40)]}
    found = Screened(
        name="A", constants=("A.b",), judges=1, effects=tuple(effects(flat, other, 0.7))
    )
    assert found.verdict == "not resolved"


def test_an_unknown_constant_is_refused() -> None:
    with pytest.raises(UsageError, match=r"there is no constant LEVELS\.exponents"):
        change(["LEVELS.exponents"], 1.3)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"only": "PATTERN;PATERN"}, "there is no tuned constant PATERN"),
        ({"judges": "turn;nobody"}, "there is no simulation whose name begins with nobody"),
    ],
)
def test_a_name_that_nothing_has_is_refused_before_anything_is_flown(
    asked: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        command.constants(**asked)
