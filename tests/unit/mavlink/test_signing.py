"""MAVLink 2 signing, with pymavlink's as the other side."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from until import until_async as until

from uavrt.core.errors import ConfigError, LinkError
from uavrt.core.messages import Command
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.link.mavlink.sending.signing import EPOCH_S, Signing, SigningKey, read_signing_key
from world import World

KEY = SigningKey(hashlib.sha256(b"over the hills").digest())
OTHER = SigningKey(bytes(32))
NOW_NS = (EPOCH_S + 300_000_000) * 10**9


@pytest.fixture
def pymavlink(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink.dialects.v20 import ardupilotmega

    assert isinstance(ardupilotmega, ModuleType)
    return ardupilotmega


def station_of(pymavlink: ModuleType, key: SigningKey, now_ns: int = NOW_NS) -> Any:
    """pymavlink's end of a link, signing, at 255/190 and link id 7."""
    mav = pymavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    mav.signing.secret_key = key.secret
    mav.signing.link_id = 7
    mav.signing.timestamp = (now_ns - EPOCH_S * 10**9) // 10_000
    mav.signing.sign_outgoing = True
    mav.signing.allow_unsigned_callback = None
    return mav


def frame_of(data: bytes) -> Frame:
    (frame,) = FrameParser().feed(data)
    return frame


def signing(key: SigningKey = KEY, unsigned: Any = "none", now_ns: int = NOW_NS) -> Signing:
    return Signing(key, lambda: now_ns, unsigned)


def writer(ours: Signing) -> FrameWriter:
    return FrameWriter(1, 191, lambda frame: ours.signature(frame, 3))


HEARTBEAT = made.heartbeat()


def test_pymavlink_believes_our_signature_and_no_other(pymavlink: ModuleType) -> None:
    station = station_of(pymavlink, KEY)
    ours = writer(signing())
    for count in range(1, 4):
        (heard,) = station.parse_buffer(ours.encode(HEARTBEAT))
        assert heard.get_signed()
        assert heard.get_link_id() == 3
        assert station.signing.sig_count == count
    with pytest.raises(pymavlink.MAVError, match="signature"):
        station.parse_buffer(writer(signing(OTHER)).encode(HEARTBEAT))
    unsigned = FrameWriter(1, 191).encode(HEARTBEAT)
    with pytest.raises(pymavlink.MAVError, match="signature"):
        station.parse_buffer(unsigned)


def test_a_frame_of_pymavlink_is_taken_once(pymavlink: ModuleType) -> None:
    ours = signing()
    station = station_of(pymavlink, KEY)
    first, second = (
        station.command_long_encode(1, 191, 512, 0, 148, 0, 0, 0, 0, 0, 0).pack(station)
        for _ in range(2)
    )
    assert ours.accepts(frame_of(first))
    assert not ours.accepts(frame_of(first))
    assert ours.accepts(frame_of(second))
    assert not ours.accepts(frame_of(first))
    assert ours.counters == {"signatures_repeated": 2}


@given(st.integers(0, 10**6), st.integers(0, 7))
def test_a_frame_with_any_bit_turned_is_refused(place: int, bit: int) -> None:
    frame = frame_of(writer(signing()).encode(HEARTBEAT))
    raw = bytearray(frame.raw)
    raw[place % len(raw)] ^= 1 << bit
    turned = Frame(
        bytes(raw),
        frame.message_id,
        frame.system_id,
        frame.component_id,
        0,
        frame.payload,
        True,
    )
    ours = signing()
    assert not ours.accepts(turned)
    assert ours.counters == {"signatures_wrong": 1}


def test_the_first_frame_of_a_stream_may_be_a_minute_behind(pymavlink: ModuleType) -> None:
    for behind_s, accepted in ((59, True), (61, False), (-3600, True)):
        station = station_of(pymavlink, KEY, NOW_NS - behind_s * 10**9)
        message = station.ping_encode(0, 0, 0, 0).pack(station)
        assert signing().accepts(frame_of(message)) is accepted


def test_a_computer_without_the_time_learns_it_from_a_signer(pymavlink: ModuleType) -> None:
    ours = signing(now_ns=0)
    station = station_of(pymavlink, KEY)
    assert ours.accepts(frame_of(station.ping_encode(0, 0, 0, 0).pack(station)))
    (heard,) = station.parse_buffer(writer(ours).encode(HEARTBEAT))
    assert heard.get_signed()


def test_unsigned_frames_are_taken_by_the_policy_only() -> None:
    tunnel_message = made.tunnel(
        0, b"\5\0\0\0", target_system=0, target_component=0, payload_length=4
    )
    radio = dialect.RadioStatus(txbuf=90)
    frames = {
        "autopilot": frame_of(FrameWriter(1, 1).encode(HEARTBEAT)),
        "autopilot's command": frame_of(FrameWriter(1, 1).encode(tunnel_message)),
        "ground": frame_of(FrameWriter(255, 190).encode(HEARTBEAT)),
        "radio": frame_of(FrameWriter(51, 68).encode(radio)),
    }
    taken = {
        policy: {name for name, frame in frames.items() if signing(KEY, policy).accepts(frame)}
        for policy in ("none", "autopilot", "all")
    }
    assert taken == {"none": {"radio"}, "autopilot": {"radio", "autopilot"}, "all": set(frames)}


def test_a_key_file_holds_64_digits_and_the_key_is_never_shown(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text(KEY.secret.hex() + "\n")
    path.chmod(0o600)
    assert read_signing_key(path) == KEY
    assert KEY.secret.hex() not in repr(KEY)
    for text in ("", "abc", KEY.secret.hex()[:-2], "passphrase"):
        path.write_text(text)
        with pytest.raises(ConfigError, match="64 hexadecimal digits"):
            read_signing_key(path)


@pytest.mark.parametrize("flavour", ["ardupilot"])
async def test_a_signing_ground_station_commands_through_ardupilot_and_another_does_not(
    make_world: Callable[..., World], tmp_path: Path, flavour: str
) -> None:
    path = tmp_path / "key"
    path.write_text(KEY.secret.hex())
    path.chmod(0o600)
    world = make_world(mavlink={"signing_key_file": str(path)}, flavour=flavour)
    async with world.flying():
        async with world.station(ack_wait_s=0.1) as (stranger, _):
            with pytest.raises(LinkError, match=r"not answer .* signs its frames") as raised:
                await stranger.ask("stop_detection")
            assert "--signing-key" in (raised.value.remedy or "")
        assert not world.of(Command)
        await until(lambda: world.counter("unsigned_refused") >= 4)
        with pytest.raises(LinkError, match="not sign them with the given key"):
            async with world.station(signing_key=OTHER):
                pass
        async with world.station(signing_key=KEY) as (friend, _):
            await friend.ask("stop_detection")
            assert friend.contact.refused == {}
        assert [command.name for command in world.of(Command)] == ["stop_detection"]
