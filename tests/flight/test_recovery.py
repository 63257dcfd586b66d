"""The experiments on recovery and resources, in their short forms."""

from pathlib import Path

import pytest
from tests.flight.conftest import FLIGHT_RATE_HZ

from uavrt_experiments.recovery.run import BURST_NAMES, Plan, run_recovery
from uavrt_experiments.resources.report import SAMPLES_LIMIT_MB_H, WRITTEN_LIMIT_MB_H
from uavrt_experiments.resources.run import Plan as ResourcePlan
from uavrt_experiments.resources.run import run_resources

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]


def test_every_process_the_supervisor_and_the_power_may_go_and_no_pulse_is_lost(
    tmp_path: Path,
) -> None:
    # Five processes and their helper once each, the connection stopped, connection and recorder
    # killed six times each as fast as they come back, the supervisor, everything at once.
    plan = Plan(
        kills=6,
        stops=1,
        bursts=2,
        supervisor_kills=1,
        power_cuts=2,
        seed=3,
        sample_rate_hz=FLIGHT_RATE_HZ,
    )
    report = run_recovery(plan, tmp_path)
    assert report.faults == ()
    killed = [kill.process for kill in report.kills]
    processes = ["recorder", "connection", "detector-1", "detector-2", "receiver", "nursery"]
    # The order is drawn; each is killed once.
    assert sorted(killed[: len(processes)]) == sorted(processes)
    after = ["connection", *BURST_NAMES, "supervisor", *["power"] * 2]
    assert killed[len(processes) :] == after
    assert report.pulses_recorded > 10
    assert report.pulses_promised > 60
    assert report.lost_from_database == 0
    assert report.lost_from_log == 0
    assert report.lost_on_ground == 0
    assert report.orphans == 0
    # A flight that is cut off goes on in its own directory.
    assert report.flights == 1
    assert report.as_dict()["resumed_s"]["power SIGKILL"]["count"] == 2


@pytest.mark.full_rate
def test_resources_are_measured_for_every_process_and_no_sample_is_lost() -> None:
    report = run_resources(ResourcePlan(minutes=0.1, tags=4, loads=(8,), load_s=4.0))
    assert report.lost_samples == 0
    assert len(report.moments) == 7
    names = {"supervisor", "receiver", "detector-1", "connection", "recorder"}
    for moment in report.moments:
        assert names <= moment.cpu_percent.keys()
        assert all(moment.pss_mb[name] > 1.0 for name in names)
    # Four tags, one of them heard, for six seconds: a commit more or less is half of it.
    assert report.written.mb_h["recorder"] > 1.0
    assert report.written.together_mb_h < 3 * WRITTEN_LIMIT_MB_H
    # Each tag's channel is kept.
    assert 0.0 < report.written.mb_h["receiver"] < 3 * 4 * SAMPLES_LIMIT_MB_H
    assert 0 < report.written.syncs_h < 3600
    assert report.growth.keys() >= {*names, "all but the radio"}
    assert report.most_tags == 8
    assert report.loads[0].cpu_percent > 0.0
