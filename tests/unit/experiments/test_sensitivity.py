"""Constants of the estimators and their changes, by name."""

from uavrt.localization import tuning
from uavrt_experiments.localization.sensitivity import records_of, scaled


def test_a_count_changes_by_at_least_one_and_a_tuple_in_all_its_numbers() -> None:
    assert scaled(2, 1.3) == 3
    assert scaled(10, 0.7) == 7
    assert scaled((1.0, 2), 0.7) == (0.7, 1)


def test_every_record_of_a_module_is_found() -> None:
    assert {"POWER_LAW", "LEVELS", "ACCEPTANCE", "FLIGHT", "RECEIVERS"} == {*records_of(tuning)}
