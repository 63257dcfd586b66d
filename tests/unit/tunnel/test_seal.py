"""Commands are taken from who has the key, once."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.errors import ConfigError, TunnelError
from uavrt.tunnel.seal import Key, SealKeeper, read_key, seal

KEY = Key(bytes(range(32)))
GROUND = (255, 190)
NOW_US = 1_700_000_000_000_000


@given(st.binary(max_size=108), st.integers(0, 1))
def test_what_was_sealed_comes_out(inside: bytes, kind: int) -> None:
    sealed = seal(inside, kind, KEY, GROUND, NOW_US)
    assert len(sealed) <= 128
    assert SealKeeper(KEY).open(sealed, GROUND, NOW_US) == (kind, inside)


@given(st.binary(min_size=1, max_size=108), st.data())
def test_any_changed_bit_is_noticed(inside: bytes, data: st.DataObject) -> None:
    sealed = bytearray(seal(inside, 0, KEY, GROUND, NOW_US))
    bit = data.draw(st.integers(0, 8 * len(sealed) - 1))
    sealed[bit // 8] ^= 1 << bit % 8
    with pytest.raises(TunnelError):
        SealKeeper(KEY).open(bytes(sealed), GROUND, NOW_US)


@given(st.binary(max_size=128))
def test_random_bytes_are_refused_by_name(payload: bytes) -> None:
    with pytest.raises(TunnelError):
        SealKeeper(KEY).open(payload, GROUND, NOW_US)


def test_a_repeated_message_is_refused() -> None:
    keeper = SealKeeper(KEY)
    sealed = seal(b"stop", 0, KEY, GROUND, NOW_US)
    keeper.open(sealed, GROUND, NOW_US)
    with pytest.raises(TunnelError, match="repeated"):
        keeper.open(sealed, GROUND, NOW_US + 5)
    with pytest.raises(TunnelError, match="repeated"):
        keeper.open(seal(b"stop", 0, KEY, GROUND, NOW_US - 1), GROUND, NOW_US + 5)


def test_a_recorded_message_of_last_week_is_refused_after_a_restart() -> None:
    old = seal(b"stop", 0, KEY, GROUND, NOW_US - 7 * 86_400 * 10**6)
    with pytest.raises(TunnelError, match="old"):
        SealKeeper(KEY).open(old, GROUND, NOW_US)


def test_another_sender_and_another_key_are_refused() -> None:
    sealed = seal(b"stop", 0, KEY, GROUND, NOW_US)
    with pytest.raises(TunnelError, match="forged"):
        SealKeeper(KEY).open(sealed, (254, 190), NOW_US)
    with pytest.raises(TunnelError, match="forged"):
        SealKeeper(Key(bytes(32))).open(sealed, GROUND, NOW_US)


def test_a_key_is_read_from_its_file_and_never_shown(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("00112233445566778899aabbccddeeff\n")
    key = read_key(path)
    assert key.secret[:3] == b"\x00\x11\x22"
    assert "11" not in repr(key)
    for bad in ("0011", "no hex"):
        path.write_text(bad)
        with pytest.raises(ConfigError, match="openssl"):
            read_key(path)
    with pytest.raises(ConfigError, match="openssl"):
        read_key(tmp_path / "nothing")
