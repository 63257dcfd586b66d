"""The table of parameters against the settings that it stands for."""

import math
from dataclasses import replace
from typing import get_args

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.config.parameters import (
    PARAMETERS,
    parameter_values,
    tags_with_overrides,
    with_parameter,
)
from uavrt.config.radios import RADIOS
from uavrt.config.settings import DetectionSettings, OperatingModeName, RadioSettings, Settings
from uavrt.core.errors import ConfigError
from uavrt.detection.modes import OperatingMode

TAG = made.tag()


def test_the_defaults_are_those_of_the_settings_and_names_fit_mavlink() -> None:
    assert parameter_values(Settings()) == {n: p.default for n, p in PARAMETERS.items()}
    assert all(len(name) <= 16 and name.isascii() for name in PARAMETERS)


@pytest.mark.parametrize("name", PARAMETERS)
def test_each_parameter_takes_its_bounds_and_nothing_beyond(name: str) -> None:
    row = PARAMETERS[name]
    low, high = RADIOS["airspy"].gains if name == "RADIO_GAIN" else (row.low, row.high)
    for value in (low, high, row.default):
        changed = with_parameter(Settings(), name, value)
        assert parameter_values(changed)[name] == value
        assert {n for n, v in parameter_values(changed).items() if v != row.default} <= {
            *(n for n, p in PARAMETERS.items() if p.default != row.default),
            name,
        }
    beyond = [low - 2, high + 1, math.nan, math.inf]
    if row.kind != "real":
        beyond.append(0.5)
    for value in beyond:
        with pytest.raises(ConfigError, match=name):
            with_parameter(Settings(), name, value)


@given(st.floats(-200, 200, width=32))
def test_a_real_parameter_keeps_what_a_float32_holds(value: float) -> None:
    changed = with_parameter(Settings(), "RADIO_PPM", value)
    assert changed.radio.frequency_correction_ppm == pytest.approx(value, rel=1e-6, abs=1e-40)


def test_a_float32_of_a_decimal_number_is_that_number() -> None:
    changed = with_parameter(Settings(), "DET_FALSE_ALARM", 0.004999999888241291)
    assert changed.detection.false_alarm_probability == 0.005


def test_the_gain_is_judged_by_the_kind_of_radio() -> None:
    settings = Settings(radio=RadioSettings(kind="airspyhf"))
    assert with_parameter(settings, "RADIO_GAIN", 8).radio.gain == 8
    with pytest.raises(ConfigError, match="whole, 0 to 8, or -1"):
        with_parameter(settings, "RADIO_GAIN", 9)


def test_an_unknown_parameter_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="known parameters are RADIO_GAIN"):
        with_parameter(Settings(), "GAIN", 1)


def test_each_number_of_the_mode_is_one_that_a_detector_knows() -> None:
    assert set(get_args(OperatingModeName)) == set(OperatingMode)
    named = [
        with_parameter(Settings(), "DET_MODE", n).detection.operating_mode for n in range(4)
    ]
    assert named == list(PARAMETERS["DET_MODE"].choices)
    assert sorted(named) == sorted(OperatingMode)


def test_k_and_false_alarm_probability_replace_those_of_every_tag() -> None:
    assert tags_with_overrides(Settings(), [TAG]) == (TAG,)
    settings = Settings(detection=DetectionSettings(k=5, false_alarm_probability=0.001))
    assert tags_with_overrides(settings, [TAG]) == (
        replace(TAG, k=5, false_alarm_probability=0.001),
    )
