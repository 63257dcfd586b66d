"""The table of processes in its three shapes, with the same code in all of them."""

import pytest

from uavrt_experiments.resources.run import run_shapes

pytestmark = [pytest.mark.full_rate, pytest.mark.timeout(300)]


def test_every_shape_of_the_table_detects_and_loses_nothing() -> None:
    report = run_shapes(tags=4, seconds=2.0, workers=2)
    shapes = {one.shape: one for one in report.shapes}
    # Supervisor, nursery, recorder, connection; then receiver and a detector (the tags lie at
    # each other's ghost places and share a worker), or decimator, channelizer and detector, or
    # all in one.
    counts = {name: one.processes for name, one in shapes.items()}
    assert counts == {"workers": 6, "stages": 7, "one": 5}
    for one in shapes.values():
        assert one.lost_samples == 0
        assert one.pulses > 0
        assert one.cpu_percent > one.chain_cpu_percent > 0.0
        assert one.pss_mb > 50.0
        assert 0.0 < one.latency_p50_ms <= one.latency_p99_ms
    assert len(report.rows()) == 3
