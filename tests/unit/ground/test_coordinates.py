"""Places written out, against published and independent values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some

from uavrt.core.earth.geodesy import utm
from uavrt.ground.store.coordinates import dms, mgrs, readout

PLACES = st.tuples(
    st.floats(min_value=-79.9, max_value=83.9), st.floats(min_value=-180.0, max_value=179.999)
)


@pytest.mark.parametrize(
    ("latitude", "longitude", "zone", "easting", "northing", "square"),
    [
        # The Eiffel tower, and others as geographers publish them.
        (48.8583, 2.2945, "31U", 448252, 5411944, "31U DQ 48251 11943"),
        (-33.857, 151.215, "56H", 334873, 6252266, None),
        # On a central meridian at the equator the false easting is exact.
        (0.0, 3.0, "31N", 500000, 0, "31N EA 00000 00000"),
        # Norway's and Svalbard's zones are wider than the rule.
        (60.5, 5.3, "32V", None, None, None),
        (78.0, 20.0, "33X", None, None, None),
    ],
)
def test_known_places_are_written_as_published(
    latitude: float,
    longitude: float,
    zone: str,
    easting: float | None,
    northing: float | None,
    square: str | None,
) -> None:
    place = some(utm(latitude, longitude))
    assert f"{place.zone}{place.band}" == zone
    if easting is not None:
        assert place.easting_m == pytest.approx(easting, abs=1.0)
        assert place.northing_m == pytest.approx(northing, abs=1.0)
    if square is not None:
        assert mgrs(place) == square


@given(PLACES)
def test_a_step_of_one_metre_is_one_metre_in_the_grid(place: tuple[float, float]) -> None:
    latitude, longitude = place
    here, there = utm(latitude, longitude), utm(latitude + 1e-5, longitude)
    assert here is not None
    assert there is not None
    if here.zone != there.zone or (latitude < 0.0 <= latitude + 1e-5):
        return
    step = math.hypot(there.easting_m - here.easting_m, there.northing_m - here.northing_m)
    # 1e-5° is 1.1057 m at the equator, 1.1169 m at the poles; the scale is 0.9996 to 1.004.
    assert 1.10 < step < 1.13


@given(PLACES)
def test_every_place_of_the_grid_has_all_readings(place: tuple[float, float]) -> None:
    text = readout(*place)
    zone, square, easting, northing = some(text.mgrs).split()
    assert len(square) == 2
    assert len(easting) == len(northing) == 5
    assert "60″" not in text.dms
    assert some(text.utm).startswith(zone)


def test_beyond_the_grid_only_degrees_are_given() -> None:
    text = readout(89.0, 10.0)
    assert text.utm is None
    assert text.dms == "89°00′00.0″N 10°00′00.0″E"


def test_seconds_never_read_sixty() -> None:
    assert dms(12.999999, "NS") == "13°00′00.0″N"
