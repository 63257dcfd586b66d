"""Sentences of a GPS receiver, and bytes that are none."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.formats.nmea import LONGEST, SentenceParser
from uavrt.ground.link.my_place import SILENCE_S, MyPlace


def sentence(body: str) -> bytes:
    total = 0
    for byte in body.encode():
        total ^= byte
    return f"${body}*{total:02X}\r\n".encode()


RMC = "GPRMC,101500.00,A,4630.0600,N,00800.1200,E,0.1,0.0,010526,,,A"
GGA = "GNGGA,101500.00,4630.0600,S,00800.1200,W,1,09,0.9,412.0,M,48.0,M,,"
GLL = "GPGLL,4630.0600,N,00800.1200,E,101500.00,A,A"


@pytest.mark.parametrize(
    ("body", "place"),
    [(RMC, (46.501, 8.002)), (GGA, (-46.501, -8.002)), (GLL, (46.501, 8.002))],
)
def test_each_kind_that_receivers_send_tells_the_place(
    body: str, place: tuple[float, float]
) -> None:
    (one,) = SentenceParser().feed(sentence(body))
    assert one.place == pytest.approx(place)


@pytest.mark.parametrize(
    "body",
    [
        RMC.replace(",A,46", ",V,46"),
        GGA.replace(",1,09", ",0,09"),
        GGA.replace(",1,09", ",8,09"),
        RMC.replace("4630", "9130"),
        RMC.replace("4630", "4675"),
        RMC.replace("00800", "18100"),
        RMC.replace("4630.0600", "nan"),
        RMC.replace("4630.0600", "4e3"),
        RMC.replace(",N,", ",,"),
        "GPRMC,101500",
        "GPGSV,3,1,11",
        "GPRMC,101500.00,A,٤٦٣٠.06,N,00800.1200,E,0,0,010526,,,A",
    ],
)
def test_what_is_no_place_on_earth_is_none(body: str) -> None:
    assert all(one.place is None for one in SentenceParser().feed(sentence(body)))


def test_a_gga_tells_the_altitude_and_a_compass_its_true_heading() -> None:
    def read(body: str) -> tuple[float | None, float | None]:
        (one,) = SentenceParser().feed(sentence(body))
        return one.altitude_amsl_m, one.heading_deg

    assert read(GGA) == (412.0, None)
    assert read(GGA.replace("412.0", "-3.5")) == (-3.5, None)
    assert read(GGA.replace("412.0", "nan")) == (None, None)
    assert read(GGA.replace("412.0", "99999")) == (None, None)
    assert read(RMC) == (None, None)
    assert read("HCHDT,271.4,T") == (None, 271.4)
    assert read("GPTHS,12.5,A") == (None, 12.5)
    assert read("GPTHS,12.5,V") == (None, None)
    assert read("HCHDT,400,T") == (None, None)
    assert read("HCHDT") == (None, None)


def test_a_sentence_counts_only_whole_and_with_its_checksum() -> None:
    parser = SentenceParser()
    whole = sentence(RMC)
    assert parser.feed(whole.replace(b"4630", b"4631")) == []
    assert parser.feed(whole.partition(b"*")[0] + b"\r\n") == []
    assert parser.bad_crc == 2
    found = [one for byte in whole for one in parser.feed(bytes([byte]))]
    assert [one.raw for one in found] == [whole.strip()]
    assert parser.feed(b"x" * 10_000) == []
    assert parser.feed(b"\n" + b"$" * 400 + whole) != []
    assert parser.skipped_bytes >= 10_000


@given(st.lists(st.binary(max_size=3 * LONGEST), max_size=20))
def test_any_bytes_do_no_harm_and_the_next_sentence_is_read(chunks: list[bytes]) -> None:
    parser = SentenceParser()
    for chunk in chunks:
        for one in parser.feed(chunk):
            one.place  # noqa: B018
    parser.feed(b"\r\n")
    (one,) = parser.feed(sentence(GLL))
    assert one.place == pytest.approx((46.501, 8.002))


def test_a_place_that_nobody_tells_any_more_is_none() -> None:
    now_s = 100.0
    mine = MyPlace(lambda: now_s)
    assert mine.place is None
    (one,) = SentenceParser().feed(sentence(RMC))
    mine.receive(one)
    assert mine.place == pytest.approx((46.501, 8.002))
    now_s += SILENCE_S + 1.0
    assert mine.place is None
