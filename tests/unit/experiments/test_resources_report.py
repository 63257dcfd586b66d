import pytest

from uavrt_experiments.resources.report import (
    KEEPER,
    NO_SAMPLES,
    RADIO,
    TOGETHER,
    Moment,
    ResourceReport,
    Written,
)


def report(first: dict[str, float], last: dict[str, float]) -> ResourceReport:
    moments = tuple(
        Moment(minute=minute, cpu_percent=dict.fromkeys(pss, 1.0), pss_mb=pss)
        for minute, pss in ((1.0, first), (30.0, last))
    )
    written = Written(mb_h={"a": 30.0, KEEPER: 100.0, RADIO: 999.0}, syncs_h=1200.0)
    return ResourceReport(tags=1, moments=moments, written=written, lost_samples=0.0)


def test_a_leak_shows_in_its_process_and_in_the_sum() -> None:
    found = report({"a": 10.0, "b": 30.0, RADIO: 50.0}, {"a": 12.0, "b": 30.0, RADIO: 90.0})
    assert found.growth["a"] == pytest.approx(0.2)
    assert found.growth["b"] == 0.0
    # The radio's stand-in is no part of the system.
    assert found.growth[TOGETHER] == pytest.approx(0.05)


def test_memory_that_moves_from_one_process_to_another_is_no_growth_of_the_whole() -> None:
    found = report({"a": 10.0, "b": 10.0}, {"a": 10.5, "b": 9.5})
    assert found.growth["a"] > 0.01
    assert found.growth[TOGETHER] == pytest.approx(0.0)


def test_memory_of_a_process_that_came_later_counts_in_the_sum_only() -> None:
    found = report({"a": 10.0}, {"a": 10.0, "late": 5.0})
    assert set(found.growth) == {"a", TOGETHER}
    assert found.growth[TOGETHER] == pytest.approx(0.5)


def test_what_is_written_is_judged_without_the_radios_stand_in_and_kept_samples() -> None:
    found = report({"a": 10.0, RADIO: 1.0}, {"a": 10.0, RADIO: 1.0})
    assert found.written.together_mb_h == 30.0
    assert found.as_dict()["written_mb_h"][NO_SAMPLES] == 30.0
    judged = {row.case: row for row in found.rows() if row.quantity == "written to disks, MB/h"}
    assert judged[NO_SAMPLES].met
    assert not judged[KEEPER].met
