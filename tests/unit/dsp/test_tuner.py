import numpy as np
import pytest
from original_tuner import original_center

from uavrt.core.errors import TunerError, UsageError
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.tuner import tune

Golden = tuple[list[float], list[tuple[float, list[int], list[float]]]]

# What the original's programs answered: tags [MHz]; centre [MHz], channels from 1, offsets [Hz]
# of tuner.py
# and of updated_tuner.py.
GOLDEN: list[Golden] = [
    ([148.709], [(148.709, [1], [0])] * 2),
    ([148.524, 148.520], [(148.5215, [2, 1], [-1250, -1500]), (148.520, [2, 1], [250, 0])]),
    (
        [148.7096, 148.5248],
        [(148.6172, [26, 76], [-1350, 1350]), (148.5248, [50, 1], [1050, 0])],
    ),
    (
        [148.5, 148.6, 148.7, 148.8],
        [
            (148.65, [61, 88, 14, 41], [0, -1250, 1250, 0]),
            (148.62, [69, 96, 22, 49], [0, -1250, 1250, 0]),
        ],
    ),
    (
        [148.500, 148.50375, 148.5075],
        [(148.5037, [100, 1, 2], [50, 50, 50]), (148.5, [1, 2, 3], [0, 0, 0])],
    ),
    ([148.524, 148.524], [(148.524, [1, 1], [0, 0])] * 2),
    ([148.50, 148.8749], [(148.6893, [51, 50], [-1800, 1850])] * 2),
]


@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize(("tags_mhz", "expected"), GOLDEN)
def test_the_original_s_cost_leads_to_the_original_s_answers(
    tags_mhz: list[float], expected: list[tuple[float, list[int], list[float]]], column: int
) -> None:
    center_mhz, channels, offsets_hz = expected[column]
    tags = np.rint(np.array(tags_mhz) * 1e6)
    center = original_center(tags, by_offset=bool(column))
    assert center == pytest.approx(center_mhz * 1e6, abs=0.5)
    steps = np.rint((tags - center) / 3750.0)
    assert [int(step) % 100 + 1 for step in steps] == channels
    assert tags - center - steps * 3750.0 == pytest.approx(offsets_hz, abs=0.5)


def test_the_original_s_cost_finds_the_three_tags_of_the_thesis_check() -> None:
    assert original_center(np.array([148.710e6, 148.731e6, 148.802e6])) == 148_747_300


def test_a_channel_shared_by_two_tags_is_marked() -> None:
    assert tune([148.524e6, 148.524e6]).shares_channel
    assert not tune([148.50e6, 148.7e6]).shares_channel


def test_tags_too_far_apart_are_refused_with_what_to_do() -> None:
    with pytest.raises(TunerError, match=r"148\.0.*151\.0.*two flights"):
        tune([148e6, 151e6])
    with pytest.raises(TunerError, match=r"375\.0 kHz|337\.5 kHz"):
        tune([148e6, 148.4e6], sample_rate_hz=375e3)


@pytest.mark.parametrize(
    ("span_hz", "factor"),
    [(0.0, 8), (260e3, 7), (330e3, 6), (999e3, 2), (1.2e6, 1), (2.69e6, 1)],
)
def test_the_band_is_widened_as_far_as_the_tags_need(span_hz: float, factor: int) -> None:
    tags = [148e6, 148e6 + span_hz / 3.0, 148e6 + span_hz]
    plan = tune(tags)
    assert plan.band_rate_hz == 3e6 / factor
    front_end = FrontEnd(
        sample_rate_hz=3e6, center_frequency_hz=plan.center_frequency_hz, frequencies_hz=tags
    )
    assert front_end.plan.frequency_channels == plan.channels
    assert front_end.plan.decimation_factor == factor


def test_no_tags_and_an_odd_number_of_channels_are_refused() -> None:
    with pytest.raises(UsageError, match="at least one tag"):
        tune([])
    with pytest.raises(UsageError, match="even number"):
        tune([148e6], channel_count=101)


@pytest.mark.parametrize("wrong", [148.71, 0.0, -148e6, float("nan"), float("inf")])
def test_frequencies_that_are_not_hertz_are_refused(wrong: float) -> None:
    with pytest.raises(UsageError, match="in hertz"):
        tune([wrong])


def test_a_single_tag_is_kept_clear_of_dc_and_on_a_channel_centre() -> None:
    plan = tune([148.709e6])
    assert plan.offsets_hz == (0.0,)
    assert abs(plan.center_frequency_hz - 148.709e6) == 7500
    assert plan.channels[0] not in (0, 1, 99)


def test_mirror_images_are_avoided() -> None:
    # The original sits half-way between two tags when it can: each is the other's image.
    plan = tune([148.7096e6, 148.5248e6])
    low, high = (148.5248e6 - plan.center_frequency_hz, 148.7096e6 - plan.center_frequency_hz)
    assert abs(low + high) >= 1000
    assert plan.image_pairs == ()
    assert plan.warnings == ()


def test_unavoidable_mirror_images_are_reported() -> None:
    # The ends leave 2 kHz of choice, in which they and the pair inside mirror each other.
    tags = [148.5e6, 148.5e6 + 251.5e3, 148.6e6, 148.6e6 + 51.5e3]
    plan = tune(tags)
    assert plan.image_pairs
    assert len(plan.warnings) == len(plan.image_pairs)
    assert "mirror image" in plan.warnings[0]


def test_tags_that_leave_no_room_for_dc_are_refused_with_what_to_do() -> None:
    tags = [148.5e6 + 1500 * k for k in range(223)]
    with pytest.raises(TunerError, match="Leave out a tag near the middle"):
        tune(tags, sample_rate_hz=375e3)
    assert tune(tags).band_rate_hz == 3e6 / 3  # room beyond the tags


def test_a_hundred_tags_are_served() -> None:
    tags = [148.5e6 + 2470 * k + 37 * (k % 5) for k in range(100)]
    plan = tune(tags)
    offsets = [tag - plan.center_frequency_hz for tag in tags]
    assert max(map(abs, offsets)) <= 126e3
    assert min(map(abs, offsets)) >= 1000
