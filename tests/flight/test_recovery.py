"""The experiments on recovery and resources, in their short forms."""

from pathlib import Path

import pytest

from uavrt.experiments.recovery import Plan, run_recovery
from uavrt.experiments.resources import Plan as ResourcePlan
from uavrt.experiments.resources import run_resources

pytestmark = [pytest.mark.flight, pytest.mark.timeout(400)]


def test_every_process_the_supervisor_and_the_power_may_go_and_no_pulse_is_lost(
    tmp_path: Path,
) -> None:
    # Five processes and their helper once each, the supervisor once, everything at once five
    # times.
    report = run_recovery(Plan(kills=6, supervisor_kills=1, power_cuts=5, seed=3), tmp_path)
    assert report.faults == ()
    killed = [kill.process for kill in report.kills]
    processes = ["recorder", "connection", "detector-1", "detector-2", "receiver", "nursery"]
    assert killed == [*processes, "supervisor", *["power"] * 5]
    assert report.pulses_recorded > 10
    assert report.lost_from_database == 0
    assert report.lost_from_log == 0
    assert report.orphans == 0
    # A flight that is cut off goes on in its own directory.
    assert report.flights == 1
    assert report.as_dict()["resumed_s"]["power SIGKILL"]["count"] == 5


def test_resources_are_measured_for_every_process_and_no_sample_is_lost() -> None:
    report = run_resources(ResourcePlan(minutes=0.1, tags=4, loads=(8,), load_s=4.0))
    assert report.lost_samples == 0
    assert len(report.moments) == 7
    names = {"supervisor", "receiver", "detector-1", "connection", "recorder"}
    for moment in report.moments:
        assert names <= moment.cpu_percent.keys()
        assert all(moment.pss_mb[name] > 1.0 for name in names)
    assert report.growth.keys() >= {*names, "all but the radio"}
    assert report.most_tags == 8
    assert report.loads[0].cpu_percent > 0.0
