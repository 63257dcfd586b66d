"""The cost of a tag list is known before it is searched for; ratios, not times."""

from dataclasses import replace

import pytest

from uavrt.cli import detect
from uavrt.messages import Tag
from uavrt.processes.search_costs import search_cost
from uavrt_experiments.detection.signals import THESIS_TAG


def tags(count: int, **changed: object) -> list[Tag]:
    """As many tags like the thesis's."""
    return [
        replace(THESIS_TAG, tag_id=2 + 2 * n, frequency_hz=148.6e6 + 1e3 * n, **changed)  # type: ignore[arg-type]
        for n in range(count)
    ]


def test_a_short_list_is_not_measured() -> None:
    assert search_cost(tags(10)) == 0.0


def test_the_cost_goes_with_the_number_of_tags_and_with_k() -> None:
    fifty = search_cost(tags(60))
    assert 0.0 < fifty < 5.0  # a busy machine takes several times as long
    assert search_cost(tags(240)) == pytest.approx(4.0 * fifty, rel=0.6)
    assert search_cost(tags(60, k=12)) > 1.2 * fifty


@pytest.mark.parametrize(("cores", "said"), [(0.7, ""), (2.3, "2.3 of this computer's cores")])
def test_a_list_dearer_than_real_time_is_told(
    cores: float, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(detect, "search_cost", lambda *_, **__: cores)
    detect._warn_of_cost(tags(3), 500.0, live=True)
    told = capsys.readouterr().err
    assert said in told
    assert ("lose samples" in told) == bool(said)
