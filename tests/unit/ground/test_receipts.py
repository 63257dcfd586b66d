"""The ground acknowledges what is safe, and takes no pulse twice."""

import errno
from pathlib import Path
from typing import Any

import made
import pytest
from some import some

from uavrt.core.errors import RecordingError
from uavrt.core.messages import PulsePose
from uavrt.ground.link import stored_pulses
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt.ground.link.protocol import GroundProtocol
from uavrt.ground.link.stored_pulses import RECEIVED_NAME, open_receipts
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.link.tunnel.own_messages.private import payload_hash
from uavrt.link.tunnel.tunnel_records import pulse_to_wire

MS = 1_000_000


def test_without_pulses_a_sign_of_life_goes_once_a_second() -> None:
    receipts = Receipts(7)
    first = some(receipts.next_due(0))
    assert first.hashes == ()
    assert receipts.next_due(999 * MS) is None
    assert receipts.next_due(1000 * MS) is not None


def test_pulses_are_acknowledged_within_150_ms_or_at_15_at_once() -> None:
    receipts = Receipts(7)
    receipts.next_due(0)
    receipts.stored(b"a")
    assert receipts.next_due(149 * MS) is None
    receipt = some(receipts.next_due(150 * MS))
    assert receipt.hashes == (payload_hash(b"a"),)
    for number in range(20):
        receipts.stored(bytes([number]))
    full = some(receipts.next_due(151 * MS))
    assert full.hashes == tuple(payload_hash(bytes([n])) for n in range(15))


def test_a_receipt_repeats_earlier_ones_for_they_may_be_lost() -> None:
    receipts = Receipts(7)
    for number in range(3):
        receipts.stored(bytes([number]))
        receipt = receipts.next_due(number * 200 * MS)
    assert receipt is not None
    assert receipt.hashes == tuple(payload_hash(bytes([n])) for n in (2, 0, 1))


def test_a_repeated_pulse_is_acknowledged_again_and_counted() -> None:
    receipts = Receipts(7)
    assert not receipts.seen(b"a")
    receipts.stored(b"a")
    receipts.next_due(0)
    assert receipts.seen(b"a")
    assert receipts.duplicates == 1
    again = some(receipts.next_due(200 * MS))
    assert payload_hash(b"a") in again.hashes


def test_after_a_restart_the_directory_still_knows_its_pulses(tmp_path: Path) -> None:
    first = open_receipts(tmp_path)
    first.stored(b"a")
    second = open_receipts(tmp_path)
    assert second.store == first.store
    assert second.seen(b"a")
    assert not second.seen(b"b")


def test_half_a_number_left_by_a_power_cut_is_cut_off(tmp_path: Path) -> None:
    first = open_receipts(tmp_path)
    first.stored(b"a")
    path = tmp_path / RECEIVED_NAME
    path.write_bytes(path.read_bytes() + b"\x01\x02\x03")
    second = open_receipts(tmp_path)
    second.stored(b"b")
    third = open_receipts(tmp_path)
    assert third.seen(b"a")
    assert third.seen(b"b")


def test_zeros_left_by_a_power_cut_are_a_new_store(tmp_path: Path) -> None:
    (tmp_path / RECEIVED_NAME).write_bytes(bytes(24))
    store = open_receipts(tmp_path).store
    assert store, "drones refuse receipts of store 0"
    assert open_receipts(tmp_path).store == store


def test_a_receipt_that_a_full_disk_did_not_take_is_written_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = open_receipts(tmp_path)
    first.stored(b"a")
    rooms = iter((0, 0, 3, 1000))

    def filling(*given: Any, **told: Any) -> "_Filling":
        return _Filling(open(*given, **told), next(rooms))

    monkeypatch.setattr(stored_pulses, "open", filling, raising=False)
    for payload in (b"b", b"c", b"d"):
        first.stored(payload)
        assert open_receipts(tmp_path).seen(b"a")
    first.stored(b"e")
    again = open_receipts(tmp_path)
    assert again.store == first.store
    assert all(again.seen(payload) for payload in (b"a", b"b", b"c", b"d", b"e"))


class _Filling:
    """A file of which a full disk takes some bytes, or none."""

    def __init__(self, file: Any, room: int) -> None:
        self._file, self._room = file, room

    def __enter__(self) -> "_Filling":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def seek(self, place: int) -> None:
        self._file.seek(place)

    def write(self, content: bytes) -> int:
        if self._room == 0:
            raise OSError(errno.ENOSPC, "no space")
        written: int = self._file.write(content[: self._room])
        return written


def test_an_empty_directory_is_a_new_store(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    assert open_receipts(tmp_path / "one").store != open_receipts(tmp_path / "two").store


def test_a_directory_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="-o"):
        open_receipts(tmp_path / "file")


def test_a_pulse_that_could_not_be_stored_is_not_acknowledged_by_the_next_frame() -> None:
    protocol = GroundProtocol(receipts=(receipts := Receipts(7)))
    writer = FrameParser(), FrameWriter(1, 191)

    def hear(message: Message) -> None:
        (frame,) = writer[0].feed(writer[1].encode(message))
        protocol.receive(frame, 0)

    beat = made.heartbeat()
    payload = pulse_to_wire(PulsePose(pulse=made.pulse(10**18), pose=None)).encode()
    pulse = made.tunnel(0, payload)
    hear(beat)
    protocol.accepted()
    hear(pulse)  # and it was not taken
    protocol.stored()
    assert not receipts.seen(payload)
    hear(beat)
    protocol.accepted()
    protocol.stored()
    assert not receipts.seen(payload)
    hear(pulse)
    protocol.accepted()
    assert not receipts.seen(payload), "taken, and not on the disk"
    protocol.stored()
    assert receipts.seen(payload)
