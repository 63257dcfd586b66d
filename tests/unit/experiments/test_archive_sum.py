"""What the manual reckons of 100 TB follows from what was measured last."""

import pytest

from uavrt_experiments.archive_sum import PAGE, RESULTS, in_page, measured, render


def test_the_manual_reckons_with_the_figures_of_the_last_measurement() -> None:
    page = PAGE.read_text(encoding="utf-8")
    now = in_page(page, render(RESULTS.read_text(encoding="utf-8")))
    assert page == now, "run: python -m uavrt_experiments.archive_sum"


def test_a_machine_that_takes_twice_the_cpu_takes_twice_the_time() -> None:
    results = RESULTS.read_text(encoding="utf-8")
    once = measured(results)
    cpu_s = once.ways[0].cpu_s
    slower = results.replace(f"| {cpu_s} s |", f"| {2 * cpu_s} s |")
    assert measured(slower).hour_cpu_s == pytest.approx(2 * once.hour_cpu_s)
    for text, found in ((results, once), (slower, measured(slower))):
        hour_s = 3600 * found.ways[0].cpu_s / found.signal_s
        assert f"takes {hour_s:.0f} s of one core" in render(text)
