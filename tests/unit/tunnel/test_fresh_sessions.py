"""A ground station uses only a session that its drone has just confirmed."""

from itertools import count, pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sealed import introduce
from virtual_time import VirtualClock

from uavrt.core.errors import LinkError, TunnelError
from uavrt.link.tunnel.gate import ALIVE_S, Sealer
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD
from uavrt.link.tunnel.own_messages.motion_messages import (
    MAX_TEXT,
    MotionState,
    decode_state,
    encode_state,
)
from uavrt.link.tunnel.own_messages.seal import (
    ALIVE_INSIDE,
    Key,
    SealKeeper,
    Session,
    keepalive_content,
    prove_answer,
    proven_answer,
    read_keepalive,
    seal,
    session_of,
)

KEY = Key(bytes(range(32)))
GROUND, DRONE = (254, 190), (1, 191)
NUMBER, COUNT = 0x1122334455667788, 1_700_000_000_000_000
SESSION = Session(NUMBER, DRONE)
NONCE = 0x0102030405060708
OFFER = MotionState(
    kind="offer", standing="confirmed", text="goto 40 m", request_id=7, order_id=8, nonce=9
)


@pytest.fixture
def clock(clock_of_test: VirtualClock) -> VirtualClock:
    clock_of_test.now_s = 100.0
    return clock_of_test


def exchange(
    clock: VirtualClock, station: Sealer, drone: SealKeeper, *, replayed: list[bytes]
) -> int:
    """Announce once a second with replays between, until the session is known; nonces sent."""
    for turn in count():
        for one in (*replayed, drone.announcement(DRONE)):
            station.accept_session(one, DRONE)
        for sealed in station.keepalives():
            try:
                _, inside = drone.open(sealed, GROUND, DRONE)
            except TunnelError:
                continue
            nonce, _ = read_keepalive(inside)
            if nonce:
                station.accept_session(drone.announcement(DRONE, nonce), DRONE)
                return turn + 1
        clock.now_s += ALIVE_S + 1e-6
    raise AssertionError


def test_the_bytes_of_a_sign_of_life_an_echo_and_a_proven_answer_are_these() -> None:
    assert seal(keepalive_content(NONCE), ALIVE_INSIDE, KEY, GROUND, COUNT, SESSION).hex() == (
        "0206000000401e18240a06004b18160db435d762080706050403020100"
    )
    drone = SealKeeper(KEY, NUMBER)
    assert drone.announcement(DRONE, NONCE).hex() == (
        "03000000887766554433221100000000000000000807060504030201900c6647fcfe223c"
    )
    answer = drone.prove_answer(encode_state(OFFER), GROUND, DRONE)
    assert answer.hex() == "118de74eaa4011c0080000000900000000000000676f746f203430206d"


def test_a_replayed_announcement_takes_no_session_away(clock: VirtualClock) -> None:
    station, drone = Sealer(KEY, GROUND), SealKeeper(KEY)
    introduce(station, drone, GROUND, DRONE)
    yesterday = SealKeeper(KEY)
    for _ in range(20):
        station.accept_session(yesterday.announcement(DRONE), DRONE)
    assert drone.open(station(b"stop", 0), GROUND, DRONE) == (0, b"stop")


def test_the_drone_s_session_is_found_among_replays_of_a_whole_season(
    clock: VirtualClock,
) -> None:
    replayed = [SealKeeper(KEY).announcement(DRONE) for _ in range(100)]
    station, drone = Sealer(KEY, GROUND), SealKeeper(KEY)
    assert exchange(clock, station, drone, replayed=replayed) <= 101
    restarted = SealKeeper(KEY)
    tries = exchange(clock, station, restarted, replayed=replayed)
    assert tries <= 2, "the sessions tried before come after the new one"
    assert restarted.open(station(b"stop", 0), GROUND, DRONE) == (0, b"stop")


def test_an_echo_counts_once_and_only_of_a_nonce_sent_a_moment_ago(clock: VirtualClock) -> None:
    station, drone = Sealer(KEY, GROUND), SealKeeper(KEY)
    station.accept_session(drone.announcement(DRONE), DRONE)
    (sealed,) = station.keepalives()
    _, inside = drone.open(sealed, GROUND, DRONE)
    nonce, _ = read_keepalive(inside)
    for other in (nonce ^ 2, 1):
        with pytest.raises(TunnelError, match="nonce"):
            station.accept_session(drone.announcement(DRONE, other), DRONE)
    echo = drone.announcement(DRONE, nonce)
    station.accept_session(echo, DRONE)
    assert station.ready
    with pytest.raises(TunnelError, match="nonce"):
        station.accept_session(echo, DRONE)
    late = Sealer(KEY, GROUND)
    late.accept_session(drone.announcement(DRONE), DRONE)
    _, inside = drone.open(late.keepalives()[0], GROUND, DRONE)
    clock.now_s += 5.1
    with pytest.raises(TunnelError, match="old nonce"):
        late.accept_session(drone.announcement(DRONE, read_keepalive(inside)[0]), DRONE)
    assert not late.ready


def test_a_drone_of_an_older_version_is_named_before_anything_is_sealed(
    clock: VirtualClock,
) -> None:
    station, old = Sealer(KEY, GROUND), SealKeeper(KEY)
    for _ in range(8):
        station.accept_session(old.announcement(DRONE), DRONE)
        station.keepalives()
        clock.now_s += 0.5
    with pytest.raises(LinkError, match=r"older than this one\. Update the drone"):
        station(b"order", 60_005)


def test_signs_of_life_are_often_enough_for_a_link_that_loses_a_fifth(
    clock: VirtualClock,
) -> None:
    station, drone = Sealer(KEY, GROUND), SealKeeper(KEY)
    introduce(station, drone, GROUND, DRONE)
    sent_s = []
    while clock.now_s < 200.0:
        clock.now_s += 0.05
        sent_s += [clock.now_s for _ in station.keepalives()]
    gaps = [later - one for one, later in pairwise(sent_s)]
    assert max(gaps) <= 0.51
    in_limit = int(4.99 / max(gaps))
    received = 0.8 * 1800.0 / max(gaps)
    assert received * 0.2**in_limit < 1e-2, "false link losses in half an hour"
    two = sum(len(station.keepalives(2)) for clock.now_s in (300.0, 300.25, 300.5, 300.75))
    assert two == 4, "each of two links carries as many"


def test_an_answer_is_proven_for_one_order_of_one_station_in_one_session() -> None:
    state = encode_state(OFFER)
    answer = prove_answer(state, KEY, SESSION, GROUND)
    got = proven_answer(answer, KEY, SESSION, GROUND, (3, 7))
    assert decode_state(got) == OFFER
    for key, session, station, orders in (
        (Key(bytes(32)), SESSION, GROUND, (7,)),
        (KEY, Session(1, DRONE), GROUND, (7,)),
        (KEY, Session(NUMBER, (2, 191)), GROUND, (7,)),
        (KEY, SESSION, (255, 190), (7,)),
        (KEY, SESSION, GROUND, (8,)),
        (KEY, SESSION, GROUND, ()),
    ):
        with pytest.raises(TunnelError, match="forged"):
            proven_answer(answer, key, session, station, orders)


@given(st.data())
def test_any_changed_bit_of_an_answer_is_noticed(data: st.DataObject) -> None:
    answer = bytearray(prove_answer(encode_state(OFFER), KEY, SESSION, GROUND))
    bit = data.draw(st.integers(0, 8 * len(answer) - 1))
    answer[bit // 8] ^= 1 << bit % 8
    with pytest.raises(TunnelError):
        proven_answer(bytes(answer), KEY, SESSION, GROUND, (7,))


@given(st.binary(max_size=MAX_PAYLOAD))
def test_random_bytes_are_no_answer_and_no_session(payload: bytes) -> None:
    with pytest.raises(TunnelError):
        proven_answer(payload, KEY, SESSION, GROUND, (7,))
    with pytest.raises(TunnelError):
        session_of(payload, KEY, DRONE)


def test_the_longest_text_fits_with_its_proof() -> None:
    longest = MotionState(kind="refused", standing="in command", text="x" * MAX_TEXT)
    answer = prove_answer(encode_state(longest), KEY, SESSION, GROUND)
    assert len(answer) == MAX_PAYLOAD
    assert decode_state(proven_answer(answer, KEY, SESSION, GROUND, (0,))) == longest
