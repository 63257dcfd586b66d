"""The cost of a tag list is known before it is searched for; ratios, not times."""

import math
from dataclasses import replace
from functools import cache

import pytest

from uavrt.cli.signals import detect
from uavrt.config.settings import DetectionSettings
from uavrt.core.clock import cpu_s
from uavrt.core.messages import Tag
from uavrt.detection.search_costs import search_cost
from uavrt_experiments.detection.signals import THESIS_TAG

pytestmark = pytest.mark.slow


def tags(count: int, **changed: object) -> list[Tag]:
    """As many tags like the thesis's."""
    return [
        replace(THESIS_TAG, tag_id=2 + 2 * n, frequency_hz=148.6e6 + 1e3 * n, **changed)  # type: ignore[arg-type]
        for n in range(count)
    ]


@cache
def usual_cost(count: int) -> float:
    """Get the least of three measurements: a busy machine spoils one of them."""
    return min(search_cost(tags(count), cpu_s) for _ in range(3))


def test_a_short_list_is_not_measured() -> None:
    assert search_cost(tags(10), cpu_s) == 0.0


def test_the_cost_goes_with_the_number_of_tags_and_with_k() -> None:
    sixty = usual_cost(60)
    assert 0.0 < sixty < 5.0  # a busy machine takes several times as long
    assert usual_cost(240) == pytest.approx(4.0 * sixty, rel=0.6)
    assert search_cost(tags(60, k=6), cpu_s) > 1.2 * sixty


def test_few_tags_of_long_groups_or_over_the_whole_channel_are_dear() -> None:
    usual = usual_cost(60) / 60.0
    long = search_cost(tags(8, k=12, interval_uncertainty_s=0.025), cpu_s)
    assert long > 30.0 * usual
    wide = DetectionSettings(frequency_window_hz=math.inf)
    assert search_cost(tags(1, k=8), cpu_s, settings=wide) > 30.0 * usual
    assert search_cost(tags(1, k=20, interval_uncertainty_s=0.002), cpu_s) == 0.0


@pytest.mark.parametrize(("live", "effect"), [(True, "lose samples"), (False, "times as long")])
def test_a_list_dearer_than_real_time_is_told(
    live: bool, effect: str, capsys: pytest.CaptureFixture[str]
) -> None:
    dear = tags(120, k=10)
    detect._warn_of_cost(dear, DetectionSettings(), live=live)
    told = capsys.readouterr().err
    assert "these 120 tags needs" in told
    assert effect in told
    detect._warn_of_cost(tags(3), DetectionSettings(), live=live)
    assert not capsys.readouterr().err
