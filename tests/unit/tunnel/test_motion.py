"""Orders of motion on the wire."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import typed

from uavrt.core.errors import TunnelError, UsageError
from uavrt.core.messages import KeepOut, MotionRequest
from uavrt.link.tunnel.own_messages.motion_messages import (
    CONTROL_STAGES,
    MAX_TEXT,
    MOTION_ACTIONS,
    MotionConfirmation,
    MotionState,
    MotionStop,
    cut_text,
    decode_motion,
    decode_state,
    encode_confirmation,
    encode_request,
    encode_state,
    encode_stop,
)
from uavrt.link.tunnel.own_messages.seal import MAX_INSIDE

ASKER = (254, 190)
places = st.lists(
    st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), min_size=0, max_size=20
)


@given(
    action=st.sampled_from(MOTION_ACTIONS),
    offsets=places,
    height=st.none() | st.integers(0, 500).map(float),
    clockwise=st.booleans(),
)
def test_what_is_asked_for_arrives_to_a_decimetre_and_fits_into_a_seal(
    action: object, offsets: list[tuple[float, float]], height: float | None, clockwise: bool
) -> None:
    most = 19 if action == "search" else 20
    corners = tuple((47.0 + a, 8.0 + b) for a, b in offsets)[:most]
    asked = MotionRequest(
        request_id=7,
        requester=ASKER,
        action=action,  # type: ignore[arg-type]
        places=corners,
        height_m=height,
        clockwise=clockwise,
    )
    payload = encode_request(asked)
    assert len(payload) <= MAX_INSIDE
    got = typed(MotionRequest, decode_motion(payload, ASKER))
    assert (got.action, got.height_m, got.clockwise) == (action, height, clockwise)
    assert len(got.places) == len(corners)
    for one, other in zip(got.places, corners, strict=True):
        assert one == pytest.approx(other, abs=1.2e-6)


BARN = KeepOut(places=((47.001, 8.0), (47.001, 8.001), (47.002, 8.001)))
PERSON = KeepOut(places=((47.003, 8.002),), radius_m=40.0)


@pytest.mark.parametrize(
    "values",
    [
        {"action": "hold"},
        {"action": "goto", "places": ((47.01, 8.01),)},
        {"action": "search", "radius_m": 300.0, "tags": (2, 4)},
        {"action": "survey", "places": ((47.0, 8.0), (47.0, 8.01), (47.01, 8.01))},
    ],
)
def test_people_and_buildings_arrive_with_an_order(values: dict[str, Any]) -> None:
    asked = MotionRequest(request_id=7, requester=ASKER, keep_out=(BARN, PERSON), **values)
    payload = encode_request(asked)
    assert payload[0] == 2
    got = typed(MotionRequest, decode_motion(payload, ASKER))
    assert len(got.places) == len(asked.places)
    assert [one.radius_m for one in got.keep_out] == [None, 40.0]
    for one, other in zip(got.keep_out, asked.keep_out, strict=True):
        for place, wanted in zip(one.places, other.places, strict=True):
            assert place == pytest.approx(wanted, abs=1.2e-6)


def test_a_circle_never_arrives_smaller() -> None:
    asked = MotionRequest(
        request_id=7, requester=ASKER, action="hold", keep_out=(replace(PERSON, radius_m=0.4),)
    )
    got = typed(MotionRequest, decode_motion(encode_request(asked), ASKER))
    assert got.keep_out[0].radius_m == 1.0
    with pytest.raises(UsageError, match="below 65536"):
        encode_request(replace(asked, keep_out=(replace(PERSON, radius_m=7e4),)))


def test_a_drone_that_knows_of_none_takes_no_order_with_people_and_buildings() -> None:
    asked = MotionRequest(request_id=7, requester=ASKER, action="hold", keep_out=(BARN,))
    payload = encode_request(asked)
    for wrong in (b"\x01" + payload[1:], payload[:-4], payload[:30]):
        with pytest.raises(TunnelError):
            decode_motion(wrong, ASKER)


def test_a_search_brings_its_tags_its_circle_and_its_wish() -> None:
    asked = MotionRequest(
        request_id=7,
        requester=ASKER,
        action="search",
        duration_s=600.0,
        tags=(2, 40_000),
        radius_m=300.0,
        accuracy_m=25.0,
    )
    assert decode_motion(encode_request(asked), ASKER) == asked
    with pytest.raises(UsageError, match="below 65536"):
        encode_request(replace(asked, tags=(70_000,)))
    with pytest.raises(UsageError, match="leave the tags out"):
        encode_request(replace(asked, tags=tuple(range(41))))


def test_a_confirmation_a_stop_and_a_state_come_back_as_they_were() -> None:
    confirmation = MotionConfirmation(
        request_id=1, order_id=2**31, nonce=2**63 - 1, sticks_unseen=True
    )
    assert decode_motion(encode_confirmation(confirmation), ASKER) == confirmation
    assert decode_motion(encode_stop(MotionStop(request_id=5)), ASKER) == MotionStop(
        request_id=5
    )
    state = MotionState(
        kind="offer",
        standing=CONTROL_STAGES[2],
        text="ü" * 54,
        request_id=3,
        order_id=4,
        nonce=5,
    )
    assert decode_state(encode_state(state)) == state


@given(
    text=st.text(
        st.characters(codec="utf-8", exclude_categories=("C", "Z"), include_characters=" "),
        max_size=300,
    )
)
def test_a_text_that_is_too_long_ends_with_an_ellipsis(text: str) -> None:
    state = MotionState(
        kind="offer", standing=CONTROL_STAGES[2], text=text, request_id=3, order_id=4, nonce=5
    )
    told = decode_state(encode_state(state)).text
    if len(text.encode()) <= MAX_TEXT:
        assert told == text
    else:
        assert len(told.encode()) <= MAX_TEXT
        assert told.endswith("…")
        assert text.startswith(told[:-1])


@given(st.binary(max_size=128))
def test_no_bytes_are_more_than_refused(payload: bytes) -> None:
    for read in (lambda p: decode_motion(p, ASKER), decode_state):
        with suppress(TunnelError):
            read(payload)


@pytest.mark.parametrize(
    "corners", [tuple((47.0, 8.0 + n / 1000) for n in range(21)), ((47.0, 8.0), (48.0, 8.0))]
)
def test_an_area_that_does_not_fit_is_refused(corners: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(UsageError, match="Draw"):
        encode_request(
            MotionRequest(request_id=1, requester=ASKER, action="survey", places=corners)
        )


NO_NUMBERS = [math.nan, math.inf, -math.inf, 1e39]


@pytest.mark.parametrize(
    ("name", "action"),
    [
        ("height_m", "hold"),
        ("duration_s", "hold"),
        ("spacing_m", "hold"),
        ("radius_m", "search"),
    ],
)
@pytest.mark.parametrize("value", NO_NUMBERS)
def test_what_is_no_number_is_not_sent(name: str, action: str, value: float) -> None:
    values: dict[str, Any] = {
        "request_id": 7,
        "requester": ASKER,
        "action": action,
        name: value,
    }
    with pytest.raises(UsageError):
        encode_request(MotionRequest(**values))


@pytest.mark.parametrize("value", NO_NUMBERS)
@pytest.mark.parametrize("corner", [0, 1])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_corner_that_is_no_number_is_no_place(value: float, corner: int, axis: int) -> None:
    corners = [[47.0, 8.0], [47.01, 8.0]]
    corners[corner][axis] = value
    places = tuple((north, east) for north, east in corners)
    asked = MotionRequest(request_id=7, requester=ASKER, action="survey", places=places)
    with pytest.raises(UsageError, match="not valid positions"):
        encode_request(asked)


def test_a_long_offer_still_says_out_of_which_mode_it_would_fly() -> None:
    tail = "; geofence unknown; in mode Position"
    survey = "survey 12 lines, from 47.123456, 8.123456 at 120 m: 12345 m in 1234 s"
    assert cut_text(survey, tail) == survey + tail
    cut = cut_text(f"{survey}, and then return by the same way", tail)
    assert cut.startswith("survey 12 lines")
    assert cut.endswith(f"…{tail}")
    assert len(cut.encode()) <= 108


def test_no_control_character_of_the_air_reaches_a_terminal() -> None:
    state = MotionState(kind="state", standing="out", text="\x1b[2K\x9b1Ahold at 40 m °")
    told = decode_state(encode_state(state)).text
    assert told == "\ufffd[2K\ufffd1Ahold at 40 m °"
