"""A search that cannot be done is refused before the flight, with what would be possible."""

import math

import made
import pytest

from uavrt.config.settings import DetectionSettings
from uavrt.core.clock import cpu_s
from uavrt.core.errors import ConfigError, TunerError
from uavrt.detection import search_plan
from uavrt.detection.search_plan import SearchPlan, plan_search
from uavrt.dsp.frontend import FrontEnd


def planned(
    frequencies_hz: list[float], window_hz: float = 500.0, **options: float
) -> SearchPlan:
    return plan_search(
        [made.tag(2 * n + 2, hz, 1.3) for n, hz in enumerate(frequencies_hz)],
        cpu_s,
        detection=DetectionSettings(frequency_window_hz=window_hz),
        **{"sample_rate_hz": 3e6, **options},
    )


def test_a_list_is_served_as_far_as_the_radio_receives() -> None:
    assert planned([148e6, 150.6e6]).warnings == ()
    with pytest.raises(TunerError, match=r"3000\.0 kHz.* 2700\.0 kHz"):
        planned([148e6, 151e6])


@pytest.mark.parametrize(
    "frequencies_hz", [[148e6], [148e6, 149.001e6], [148e6, 148.09e6, 150e6]]
)
def test_the_widest_window_that_is_named_can_be_searched_in_each_channel(
    frequencies_hz: list[float],
) -> None:
    with pytest.raises(ConfigError, match="Hz is the widest") as refused:
        planned(frequencies_hz, 4000.0)
    widest_hz = float(str(refused.value).split("channel, where ")[1].split(" Hz")[0])
    center_hz = planned(frequencies_hz, 500.0).center_frequency_hz
    plan = FrontEnd(
        sample_rate_hz=3e6, center_frequency_hz=center_hz, frequencies_hz=frequencies_hz
    ).plan
    centers = dict(zip(plan.channels_in_use, plan.channel_centers_hz, strict=True))
    number = int(str(refused.value).split("around tag ")[1].split()[0]) // 2 - 1
    away_hz = abs(frequencies_hz[number] - centers[plan.frequency_channels[number]])
    assert away_hz + widest_hz == pytest.approx(0.4 * plan.channel_rate_hz, abs=1.0)
    planned(frequencies_hz[number : number + 1], widest_hz, center_frequency_hz=center_hz)


def test_every_tag_has_room_for_the_usual_window() -> None:
    frequencies_hz = [148e6 + 700.0 * n for n in range(40)]
    assert abs(planned(frequencies_hz, 500.0).center_frequency_hz - 148e6) < 1.5e6


def test_tags_that_the_radio_does_not_receive_need_no_room() -> None:
    far = planned([148e6, 152e6], 900.0, center_frequency_hz=148.0075e6)
    assert far.center_frequency_hz == 148.0075e6


def test_a_list_that_the_computer_cannot_carry_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(search_plan, "search_cost", lambda *_, **__: 2.4)
    assert planned([148e6], spare_cores=3).cores == 2.4
    assert planned([148e6], spare_cores=math.inf).cores == 2.4
    with pytest.raises(TunerError, match=r"needs 2\.4 processor cores, but only 2 are avail"):
        planned([148e6], spare_cores=2)
