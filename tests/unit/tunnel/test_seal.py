"""Commands are taken from who has the key, once."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sealed import introduce

from uavrt.core.errors import ConfigError, LinkError, TunnelError
from uavrt.link.mavlink.sending.signing import read_signing_key
from uavrt.link.tunnel.gate import Sealer
from uavrt.link.tunnel.own_messages.seal import (
    Key,
    SealKeeper,
    Session,
    read_key,
    seal,
    session_of,
)

KEY = Key(bytes(range(32)))
GROUND, DRONE = (255, 190), (1, 191)
NUMBER = 0x1122334455667788
SESSION = Session(NUMBER, DRONE)
COUNT = 1_700_000_000_000_000


def keeper(key: Key = KEY, session: int | None = NUMBER) -> SealKeeper:
    return SealKeeper(key, session)


@given(st.binary(max_size=108), st.integers(0, 2))
def test_what_was_sealed_comes_out(inside: bytes, kind: int) -> None:
    sealed = seal(inside, kind, KEY, GROUND, COUNT, SESSION)
    assert len(sealed) <= 128
    assert keeper().open(sealed, GROUND, DRONE) == (kind, inside)


@given(st.binary(min_size=1, max_size=108), st.data())
def test_any_changed_bit_is_noticed(inside: bytes, data: st.DataObject) -> None:
    sealed = bytearray(seal(inside, 0, KEY, GROUND, COUNT, SESSION))
    bit = data.draw(st.integers(0, 8 * len(sealed) - 1))
    sealed[bit // 8] ^= 1 << bit % 8
    with pytest.raises(TunnelError):
        keeper().open(bytes(sealed), GROUND, DRONE)


def test_the_bytes_of_a_seal_and_of_a_session_are_these() -> None:
    assert seal(b"stop", 0, KEY, GROUND, COUNT, SESSION).hex() == (
        "0200000000401e18240a0600ed447592e9b5d4b673746f70"
    )
    assert keeper().announcement(DRONE).hex() == (
        "02000000887766554433221100000000000000007dd8486996c1cba6"
    )


def test_a_repeated_message_is_refused() -> None:
    drone = keeper()
    sealed = seal(b"stop", 0, KEY, GROUND, COUNT, SESSION)
    drone.open(sealed, GROUND, DRONE)
    for old in (sealed, seal(b"stop", 0, KEY, GROUND, COUNT - 1, SESSION)):
        with pytest.raises(TunnelError, match="repeats"):
            drone.open(old, GROUND, DRONE)


def test_a_genuine_stop_is_refused_after_a_restart_whatever_the_clocks_say() -> None:
    first = SealKeeper(KEY)
    told, *_ = session_of(first.announcement(DRONE), KEY, DRONE)
    stop = seal(b"stop", 0, KEY, GROUND, COUNT, told)
    assert first.open(stop, GROUND, DRONE) == (0, b"stop")
    for _ in range(20):
        with pytest.raises(TunnelError, match="earlier session"):
            SealKeeper(KEY).open(stop, GROUND, DRONE)


def test_a_message_to_one_drone_is_none_to_another_with_the_same_key() -> None:
    stop = seal(b"stop", 0, KEY, GROUND, COUNT, SESSION)
    with pytest.raises(TunnelError, match="other drone"):
        keeper().open(stop, GROUND, (2, 191))


def test_a_station_whose_clock_fell_back_goes_on_above_the_newest_counter() -> None:
    drone = keeper()
    drone.open(seal(b"", 0, KEY, GROUND, 2**60, SESSION), GROUND, DRONE)
    station = Sealer(KEY, GROUND)  # started again; its clock knows nothing of 2**60
    assert not station.ready
    with pytest.raises(LinkError, match="no session for sealed"):
        station(b"stop", 0)
    introduce(station, drone, GROUND, DRONE)
    assert drone.open(station(b"stop", 0), GROUND, DRONE) == (0, b"stop")
    assert drone.open(station(b"stop", 0), GROUND, DRONE) == (0, b"stop")


def test_a_session_that_another_key_or_drone_made_is_not_believed() -> None:
    station = Sealer(KEY, GROUND)
    told = keeper().announcement(DRONE)
    for payload, place in (
        (keeper(Key(bytes(32))).announcement(DRONE), DRONE),
        (told, (2, 191)),
        (told[:-1] + bytes([told[-1] ^ 1]), DRONE),
        (told + b"\0", DRONE),
    ):
        with pytest.raises(TunnelError):
            station.accept_session(payload, place)
    assert not station.ready


def test_another_sender_and_another_key_are_refused() -> None:
    sealed = seal(b"stop", 0, KEY, GROUND, COUNT, SESSION)
    with pytest.raises(TunnelError, match="forged"):
        keeper().open(sealed, (254, 190), DRONE)
    with pytest.raises(TunnelError, match="forged"):
        keeper(Key(bytes(32))).open(sealed, GROUND, DRONE)


def test_a_key_is_read_from_its_file_and_never_shown(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("00112233445566778899aabbccddeeff\n")
    path.chmod(0o600)
    key = read_key(path)
    assert key.secret[:3] == b"\x00\x11\x22"
    assert "11" not in repr(key)
    for bad in ("0011", "no hex"):
        path.write_text(bad)
        with pytest.raises(ConfigError, match="openssl"):
            read_key(path)
    with pytest.raises(ConfigError, match="openssl"):
        read_key(tmp_path / "nothing")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o620, 0o666])
def test_a_key_that_others_may_read_or_change_is_refused_with_the_remedy(
    tmp_path: Path, mode: int
) -> None:
    path = tmp_path / "key"
    path.write_text("5a" * 32)
    path.chmod(mode)
    for read in (read_key, read_signing_key):
        with pytest.raises(ConfigError, match=r"other users can read .* chmod 600"):
            read(path)
    path.chmod(0o600)
    assert read_key(path).secret == read_signing_key(path).secret
