"""Frequency and gain of a start as the page's settings take them."""

import pytest

from uavrt.core.errors import UavrtError
from uavrt.ground.store.ground_settings import GroundSettings


@pytest.mark.parametrize(
    ("name", "value", "kept"),
    [
        ("gain", "14", 14),
        ("gain", 102, 102),
        ("gain", "", None),
        ("center_frequency_mhz", "148,705", 148.705),
        ("center_frequency_mhz", 148.7, 148.7),
        ("center_frequency_mhz", None, None),
    ],
)
def test_what_a_radio_can_be_set_to_is_kept(name: str, value: object, kept: object) -> None:
    assert getattr(GroundSettings().changed({name: value}), name) == kept


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("gain", "1_5", "RADIO_GAIN cannot be nan: whole, 0 to 120"),
        ("gain", "14.5", "RADIO_GAIN cannot be 14.5: whole, 0 to 120"),
        ("gain", 121, "RADIO_GAIN cannot be 121: whole, 0 to 120"),
        ("gain", True, "RADIO_GAIN cannot be nan"),
        ("center_frequency_mhz", "nan", "nan MHz is not supported: choose 20 to 1000 MHz"),
        ("center_frequency_mhz", "1_48", "nan MHz is not supported: choose 20 to 1000 MHz"),
        ("center_frequency_mhz", 148705000, "148705000 MHz is not supported: choose 20"),
        ("center_frequency_mhz", -148.7, "-148.7 MHz is not supported: choose 20"),
    ],
)
def test_anything_else_is_refused_with_the_range(name: str, value: object, reason: str) -> None:
    with pytest.raises(UavrtError, match=reason):
        GroundSettings().changed({name: value})
