import math

from hypothesis import given
from hypothesis import strategies as st

from uavrt.drone.processes.samples.latencies import Latencies

SECONDS = st.floats(0.0, 9.0)


@given(st.lists(SECONDS, min_size=1, max_size=200), st.sampled_from([50.0, 99.0]))
def test_so_many_per_cent_of_the_latencies_are_not_above_the_figure(
    latencies_s: list[float], percent: float
) -> None:
    measured = Latencies()
    for latency_s in latencies_s:
        measured.add(latency_s, now_s=100.0)
    figure_ms = measured.percentile_ms(percent)
    assert figure_ms is not None
    ordered = sorted(latencies_s)
    exact_ms = 1e3 * ordered[math.ceil(len(ordered) * percent / 100.0) - 1]
    assert exact_ms <= figure_ms <= exact_ms + 1.0 + 1e-6


def test_what_was_long_ago_is_forgotten() -> None:
    measured = Latencies()
    measured.add(5.0, now_s=0.0)
    for now_s in (31.0, 62.0, 93.0):
        measured.add(0.010, now_s=now_s)
    assert measured.counters() == {"latency_p50_ms": 11.0, "latency_p99_ms": 11.0}


def test_without_samples_there_is_no_latency() -> None:
    assert Latencies().counters() == {}
