"""The file server against clients that nobody here wrote, and against bad requests."""

import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from uavrt.link.mavlink.dialect import FileTransferProtocol
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.services.ftp_files import FileTree
from uavrt.link.mavlink.services.ftp_server import MAX_SESSIONS, FileServer
from uavrt.link.mavlink.services.ftp_wire import (
    DATA_SIZE,
    FtpError,
    FtpPacket,
    Opcode,
    checksum,
)

CLIENT = Peer(255, 190)
OTHER = Peer(245, 190)
FLIGHT, EMPTY = "/flight_log_1/flight.sqlite", "/flight_log_1/empty.txt"
CONTENT = random.Random(5).randbytes(8_000)


@pytest.fixture(name="flights")
def flights_fixture(tmp_path: Path) -> Path:
    root = tmp_path / "flights"
    (root / "flight_log_1" / "iq").mkdir(parents=True)
    (root / "flight_log_1" / "flight.sqlite").write_bytes(CONTENT)
    (root / "flight_log_1" / "empty.txt").write_bytes(b"")
    (tmp_path / "secret").write_text("not yours")
    (root / "link").symlink_to(tmp_path / "secret")
    (root / "link_directory").symlink_to(tmp_path)
    os.mkfifo(root / "pipe")
    return root


class Requester:
    """Sends requests and takes the replies, without a link."""

    def __init__(self, server: FileServer, peer: Peer = CLIENT) -> None:
        self.server, self.peer, self.sequence = server, peer, 0

    def replies(self) -> list[FtpPacket]:
        found = []
        for _ in range(200):
            self.server.work()
        while (message := self.server.take(0, 1e4)) is not None if self.waits() else False:
            assert isinstance(message, FileTransferProtocol)
            assert message.target_system == self.peer.system_id
            found.append(FtpPacket.decode(message.payload))
        return found

    def waits(self) -> bool:
        return self.server.wait_ns(0) == 0

    def ask(self, opcode: int, path: str = "", **values: Any) -> FtpPacket:
        self.sequence += 2
        data = {"data": path.encode()} if path else {}
        packet = FtpPacket(sequence=self.sequence, opcode=opcode, **data, **values)  # type: ignore[arg-type]
        self.server.receive(packet.encode(), self.peer, 0)
        (reply,) = self.replies()
        assert reply.sequence == self.sequence + 1
        assert reply.request_opcode == opcode
        assert reply.session == packet.session
        return reply


@pytest.fixture
def requester(flights: Path) -> Iterator[Requester]:
    server = FileServer(FileTree(flights, {"general.json": b"{}"}))
    yield Requester(server)
    server.close()


def error_of(reply: FtpPacket) -> FtpError:
    assert reply.opcode == Opcode.NAK
    return FtpError(reply.data[0])


def test_a_directory_is_listed_without_links_and_pipes(requester: Requester) -> None:
    reply = requester.ask(Opcode.LIST_DIRECTORY, "/")
    assert reply.data == b"Dflight_log_1\0Fgeneral.json\t2\0"
    inside = requester.ask(Opcode.LIST_DIRECTORY, "/flight_log_1").data
    assert inside == b"Fempty.txt\t0\0Fflight.sqlite\t8000\0Diq\0"
    past = requester.ask(Opcode.LIST_DIRECTORY, "/flight_log_1", offset=3)
    assert error_of(past) is FtpError.END_OF_FILE


@pytest.mark.parametrize(
    "path",
    [
        *("/../secret", "/flight_log_1/../../secret", "/link", "/link_directory/secret"),
        *("/flight_log_1", "/pipe", "/nothing", "/flight_log_1/flight.sqlite/x", "a" * 230),
    ],
)
@pytest.mark.parametrize("opcode", [Opcode.OPEN_FILE_RO, Opcode.CALC_FILE_CRC32])
def test_what_is_outside_or_no_file_cannot_be_opened(
    requester: Requester, path: str, opcode: int
) -> None:
    assert error_of(requester.ask(opcode, path)) in (
        FtpError.FILE_NOT_FOUND,
        FtpError.FAIL_ERRNO,
    )


def test_a_link_cannot_be_listed_through(requester: Requester) -> None:
    reply = requester.ask(Opcode.LIST_DIRECTORY, "/link_directory")
    assert error_of(reply) is FtpError.FILE_NOT_FOUND


@pytest.mark.parametrize("opcode", [6, 7, 8, 9, 10, 11, 12, 13])
def test_nothing_can_be_written(requester: Requester, opcode: int, flights: Path) -> None:
    before = sorted(flights.rglob("*"))
    reply = requester.ask(opcode, FLIGHT)
    assert error_of(reply) is FtpError.FILE_PROTECTED
    assert sorted(flights.rglob("*")) == before


def test_an_unknown_opcode_is_refused_at_once(requester: Requester) -> None:
    assert error_of(requester.ask(16, "/")) is FtpError.UNKNOWN_COMMAND


@pytest.mark.parametrize("session", [0, 1, 77, 255])
def test_a_file_is_read_under_the_clients_session(requester: Requester, session: int) -> None:
    opened = requester.ask(Opcode.OPEN_FILE_RO, FLIGHT, session=session)
    assert int.from_bytes(opened.data, "little") == len(CONTENT)
    got = b""
    while True:
        reply = requester.ask(
            Opcode.READ_FILE, session=session, offset=len(got), size=DATA_SIZE
        )
        if reply.opcode == Opcode.NAK:
            break
        got += reply.data
    assert error_of(reply) is FtpError.END_OF_FILE
    assert got == CONTENT
    assert requester.ask(Opcode.TERMINATE_SESSION, session=session).opcode == Opcode.ACK
    gone = requester.ask(Opcode.READ_FILE, session=session, size=10)
    assert error_of(gone) is FtpError.INVALID_SESSION


def test_a_burst_gives_the_file_in_parts_until_it_asks_to_go_on(requester: Requester) -> None:
    requester.ask(Opcode.OPEN_FILE_RO, FLIGHT)
    got, bursts = b"", 0
    while len(got) < len(CONTENT):
        requester.sequence += 2
        request = FtpPacket(
            sequence=requester.sequence,
            opcode=Opcode.BURST_READ_FILE,
            offset=len(got),
            size=200,
        )
        requester.server.receive(request.encode(), CLIENT, 0)
        parts = requester.replies()
        assert [p.sequence for p in parts] == [
            requester.sequence + 1 + i for i in range(len(parts))
        ]
        if parts[-1].opcode == Opcode.NAK:
            assert FtpError(parts.pop().data[0]) is FtpError.END_OF_FILE
        else:
            assert parts[-1].burst_complete
        assert not any(part.burst_complete for part in parts[:-1])
        for part in parts:
            assert part.offset == len(got)
            got += part.data
        bursts += 1
    assert got == CONTENT
    assert bursts == 2  # half a second at 10 kB/s each
    end = requester.ask(Opcode.BURST_READ_FILE, offset=len(CONTENT), size=200)
    assert error_of(end) is FtpError.END_OF_FILE


def test_a_repeated_request_gets_the_same_reply_and_is_done_once(requester: Requester) -> None:
    requester.ask(Opcode.OPEN_FILE_RO, FLIGHT)
    request = FtpPacket(
        sequence=requester.sequence,
        opcode=Opcode.OPEN_FILE_RO,
        data=FLIGHT.encode(),
    )
    requester.server.receive(request.encode(), CLIENT, 0)
    (again,) = requester.replies()
    assert again.opcode == Opcode.ACK
    assert requester.server.counters()["ftp_sessions"] == 1
    assert requester.server.repeated == 1
    requester.ask(Opcode.TERMINATE_SESSION)
    terminate = FtpPacket(sequence=requester.sequence, opcode=Opcode.TERMINATE_SESSION)
    requester.server.receive(terminate.encode(), CLIENT, 0)
    (still,) = requester.replies()
    assert still.opcode == Opcode.ACK


def test_sessions_of_clients_are_apart_and_bounded(requester: Requester) -> None:
    other = Requester(requester.server, OTHER)
    requester.ask(Opcode.OPEN_FILE_RO, FLIGHT)
    other.ask(Opcode.OPEN_FILE_RO, EMPTY)
    assert requester.ask(Opcode.READ_FILE, size=5).data == CONTENT[:5]
    assert error_of(other.ask(Opcode.READ_FILE, size=5)) is FtpError.END_OF_FILE
    other.ask(Opcode.RESET_SESSIONS)
    assert requester.ask(Opcode.READ_FILE, size=5, offset=5).data == CONTENT[5:10]
    for session in range(1, MAX_SESSIONS):
        requester.ask(Opcode.OPEN_FILE_RO, EMPTY, session=session)
    full = requester.ask(Opcode.OPEN_FILE_RO, EMPTY, session=99)
    assert error_of(full) is FtpError.NO_SESSIONS_AVAILABLE


def test_checksums_in_the_making_are_bounded(requester: Requester) -> None:
    path = FLIGHT.encode()
    for number in range(20):
        packet = FtpPacket(sequence=2 * number, opcode=Opcode.CALC_FILE_CRC32, data=path)
        requester.server.receive(packet.encode(), CLIENT, 0)
    replies = requester.replies()
    assert [r.opcode for r in replies].count(Opcode.ACK) == MAX_SESSIONS
    refused = [reply for reply in replies if reply.opcode == Opcode.NAK]
    assert {error_of(reply) for reply in refused} == {FtpError.NO_SESSIONS_AVAILABLE}
    assert len(replies) == 20


def test_the_checksum_is_that_of_the_service(requester: Requester) -> None:
    reply = requester.ask(Opcode.CALC_FILE_CRC32, FLIGHT)
    assert int.from_bytes(reply.data, "little") == checksum(CONTENT)
    # The usual check value with start 0 and no inversion (CRC-32/JAMCRC starts at all ones).
    assert checksum(b"123456789") == 0x2DFD2D88


@settings(deadline=None, max_examples=300)
@given(st.lists(st.binary(min_size=251, max_size=251), max_size=8))
def test_any_bytes_are_answered_and_change_nothing(payloads: list[bytes]) -> None:
    server = FileServer(FileTree("/nonexistent", {"a": b"123"}))
    for number, payload in enumerate(payloads):
        server.receive(payload, CLIENT, number)
        for _ in range(300):
            if server.wait_ns(number) != 0:
                break
            server.take(number, 1e4)
        server.work()
    assert server.counters()["ftp_sessions"] <= MAX_SESSIONS
    server.close()


# ------------------------------------------------------------- clients from elsewhere


def test_eight_idle_sessions_shut_nobody_out(flights: Path) -> None:
    server = FileServer(FileTree(flights))
    idle, busy = Requester(server, OTHER), Requester(server, CLIENT)
    for session in range(MAX_SESSIONS):
        opened = idle.ask(Opcode.OPEN_FILE_RO, EMPTY, session=session)
        assert opened.opcode == Opcode.ACK
    for _ in range(3):
        opened = busy.ask(Opcode.OPEN_FILE_RO, FLIGHT, session=1)
        assert opened.opcode == Opcode.ACK
        again = idle.ask(Opcode.OPEN_FILE_RO, EMPTY, session=0)
        assert error_of(again) in (None, FtpError.NO_SESSIONS_AVAILABLE)
        assert busy.ask(Opcode.READ_FILE, session=1, size=5).data == CONTENT[:5]
    counters = server.counters()
    assert counters["ftp_sessions"] == MAX_SESSIONS
    assert counters["ftp_sessions_given_up"] >= 1
    server.close()
