"""Lists of beeping tags as groups and makers write them: CSV with a heading."""

import pytest

from uavrt.config.tags.tag_files import parse_tags
from uavrt.core.errors import TagFileError

MAKER = """\
Frequency (MHz),Pulse rate (ppm),Mortality rate (ppm),Pulse width (ms),Animal
150.123,40,80,18,F01
150.143,55,110,18,M02
"""


def test_a_makers_sheet_gives_pulses_a_minute_and_a_rate_of_mortality() -> None:
    one, two = parse_tags(MAKER.encode(), name="ats.csv")
    assert (one.tag_id, one.name, one.frequency_hz) == (1, "F01", 150_123_000.0)
    assert one.pulse_intervals_s == pytest.approx((1.5, 0.75))
    assert (two.tag_id, two.name, two.pulse_width_s) == (2, "M02", 0.018)
    assert two.pulse_intervals_s == pytest.approx((60.0 / 55.0, 60.0 / 110.0))


@pytest.mark.parametrize(
    "text",
    [
        "id,name,frequency_mhz,interval_ms,pulse_width_ms\n7,Luna,150.123,1500,18\n",
        "ID;Name;Frequency (MHz);BPM;Pulse width (ms);Sex\n7;Luna;150,123;40;18;f\n",
        "name\tid\tfreq_hz\tinterval_ms\tpulse_width_ms\nLuna\t7\t150123000\t1500\t18\n",
        "# id, frequency, pulses per minute, pulse_width_ms, name\n7, 150.123, 40, 18, Luna\n",
    ],
)
def test_columns_in_any_order_are_found_by_their_names(text: str) -> None:
    (tag,) = parse_tags(text.encode(), name="beeps.csv")
    assert (tag.tag_id, tag.name, tag.frequency_hz) == (7, "Luna", 150_123_000.0)
    assert (tag.pulse_intervals_s, tag.pulse_width_s) == ((1.5,), 0.018)


def test_each_fault_of_a_list_is_reported_with_its_line() -> None:
    text = (
        "frequency_mhz,pulse_rate_ppm,width\n150123,40,18\n150.143,0,18\n150.163,,18\n"
        "150.183,40\n"
    )
    with pytest.raises(TagFileError) as caught:
        parse_tags(text.encode(), name="beeps.csv")
    faults = "\n".join(caught.value.faults)
    assert "line 2: frequency_mhz 150123 looks like kHz but is read as MHz" in faults
    assert "line 3: pulse_rate_ppm 0 must be above 0" in faults
    assert "line 4: this tag has no interval_ms or pulse_rate_ppm; width is not known" in faults
    assert "line 5: 2 values where the heading has 3, none for width" in faults


def test_the_heading_of_the_original_ground_station_stays_its_own_format() -> None:
    heading = "id, freq_hz, ip_msecs, pulse_width_msecs, a, b, k, c\n"
    text = f"{heading}2, 148710000, 1254, 20, 60, 10, 3, 0.005\n"
    (tag,) = parse_tags(text.encode(), name="TagInfo.txt")
    assert (tag.tag_id, tag.false_alarm_probability) == (2, 0.005)
