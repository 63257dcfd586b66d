"""Reports of gpsd, and lines that are none."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.formats.gpsd import LONGEST, GpsdParser

TPV = {"class": "TPV", "device": "/dev/ttyACM0", "mode": 3, "lat": 46.501, "lon": -8.002}


def line(report: object) -> bytes:
    return json.dumps(report).encode() + b"\r\n"


@pytest.mark.parametrize(
    ("more", "altitude_m"),
    [
        ({"altMSL": 412.5, "alt": 460.0}, 412.5),
        ({"alt": 460.0}, 460.0),
        ({"mode": 2}, None),
        ({"speed": "unknown", "epx": [1]}, None),
    ],
)
def test_a_fix_tells_place_and_altitude_above_the_sea(
    more: dict[str, object], altitude_m: float | None
) -> None:
    (one,) = GpsdParser().feed(line(TPV | more))
    assert one.place == (46.501, -8.002)
    assert one.altitude_amsl_m == altitude_m
    assert one.heading_deg is None


def test_a_compass_tells_its_heading_and_what_has_no_fix_no_place() -> None:
    parser = GpsdParser()
    (compass,) = parser.feed(line({"class": "ATT", "heading": 271.4, "mode": 3}))
    assert (compass.place, compass.heading_deg) == (None, 271.4)
    (blind,) = parser.feed(line(TPV | {"mode": 1}))
    assert blind.place is None
    (half,) = parser.feed(line({"class": "TPV", "mode": 3, "lat": 46.0}))
    assert half.place is None


@pytest.mark.parametrize(
    "bad",
    [
        b"\n",
        line(TPV | {"lat": 91.0}),
        line(TPV | {"lon": -181}),
        line(TPV | {"lat": "46.5"}),
        line(TPV | {"lat": True}),
        line([TPV]),
        line({"mode": 3}),
        b'{"class":"TPV","mode":3,"lat":NaN,"lon":1}\n',
        b'{"class":"TPV"' + b"[" * 5000 + b"\n",
        b'{"class":"TPV","mode":1e400}\n',
        b"\xff\xfe\n",
        line({"class": "SKY", "satellites": []}),
    ],
)
def test_what_is_no_report_is_passed_over_and_counted(bad: bytes) -> None:
    parser = GpsdParser()
    assert parser.feed(bad) == []
    assert bad == b"\n" or parser.bad_crc + parser.skipped_bytes > 0
    assert len(parser.feed(line(TPV))) == 1


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_any_bytes_do_no_harm_and_the_next_report_is_read(chunks: list[bytes]) -> None:
    parser = GpsdParser()
    for chunk in chunks:
        parser.feed(chunk)
    parser.feed(b"\n")
    (one,) = parser.feed(line(TPV))
    assert one.place == (46.501, -8.002)


def test_a_line_without_an_end_is_not_kept() -> None:
    parser = GpsdParser()
    for _ in range(10):
        parser.feed(b"x" * LONGEST)
    assert parser.skipped_bytes >= 8 * LONGEST
    parser.feed(b"\n")
    assert len(parser.feed(line(TPV))) == 1
