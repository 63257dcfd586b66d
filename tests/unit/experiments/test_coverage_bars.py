"""Areas that a map says to be empty are so as often as it says; the command has more."""

from uavrt_experiments.coverage import absence_row


def test_areas_said_to_be_empty_are_so_as_often_as_it_is_said() -> None:
    row = absence_row(60, worlds=1, seed=3)
    assert row.n == 60
    assert not row.contradicted
    assert row.figure > 0.85
