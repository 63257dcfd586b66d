"""`uavrt fetch` against the drone's file server, over a link that loses."""

import asyncio
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from uavrt.errors import LinkError
from uavrt.ground.fetch import (
    MOST_DEEP,
    PART_SUFFIX,
    FileClient,
    RemoteEntry,
    fetch_file,
    file_checksum,
)
from uavrt.mavlink import Peer
from uavrt.mavlink.dialect import FileTransferProtocol
from uavrt.mavlink.ftp_files import FileTree
from uavrt.mavlink.ftp_server import FileServer
from uavrt.mavlink.ftp_wire import FtpError, FtpPacket, Opcode

CONTENT = random.Random(6).randbytes(30_011)
US = Peer(255, 197)


class Pair:
    """Client and server back to back, with loss both ways."""

    def __init__(self, root: Path, loss: float = 0.0) -> None:
        self.server = FileServer(FileTree(root))
        self.random = random.Random(9)
        self.loss = loss
        self.sent_bytes = 0
        self.client = FileClient(self._ask, lambda: 0, session=77)

    def _ask(self, payload: bytes) -> None:
        if self.random.random() >= self.loss:
            asyncio.get_running_loop().call_soon(self._serve, payload)

    def _serve(self, payload: bytes) -> None:
        self.server.receive(payload, US, 0)
        for _ in range(4):
            self.server.work()
        while self.server.wait_ns(0) == 0:
            message = self.server.take(0, 8000.0)
            assert isinstance(message, FileTransferProtocol)
            self.sent_bytes += len(message.pack().rstrip(b"\0"))
            if self.random.random() >= self.loss:
                self.client.receive(message.payload)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    flight = tmp_path / "drone" / "flight_log_1"
    (flight / "detector_log").mkdir(parents=True)
    (flight / "flight.sqlite").write_bytes(CONTENT)
    (flight / "detector_log" / "a.log").write_text("hello")
    for number in range(40):
        (flight / f"a_rather_long_name_{number:03}.txt").write_text(str(number))
    return tmp_path / "drone"


ENTRY = RemoteEntry(path="/flight_log_1/flight.sqlite", size=len(CONTENT))


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lost reply is waited for 20 ms and not a second and a half."""
    monkeypatch.setattr("uavrt.ground.fetch.REPLY_NS", 20_000_000)
    monkeypatch.setattr("uavrt.ground.fetch.QUIET_NS", 20_000_000)


def test_a_tree_longer_than_a_reply_is_listed_whole(root: Path) -> None:
    files = asyncio.run(Pair(root).client.tree("/")).files
    assert len(files) == 42
    assert ENTRY in files
    assert RemoteEntry(path="/flight_log_1/detector_log/a.log", size=5) in files


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.3])
def test_a_file_arrives_whole_whatever_is_lost(root: Path, tmp_path: Path, loss: float) -> None:
    pair = Pair(root, loss)
    place = tmp_path / "here" / "flight.sqlite"
    shown: list[tuple[int, int]] = []
    new = asyncio.run(
        fetch_file(pair.client, ENTRY, place, lambda done, size: shown.append((done, size)))
    )
    assert new
    assert place.read_bytes() == CONTENT
    assert shown[-1] == (len(CONTENT), len(CONTENT))
    assert shown == sorted(shown)


def test_what_is_here_already_is_not_fetched_again(root: Path, tmp_path: Path) -> None:
    pair = Pair(root)
    place = tmp_path / "flight.sqlite"

    async def twice() -> int:
        assert await fetch_file(pair.client, ENTRY, place)
        before = pair.sent_bytes
        assert not await fetch_file(pair.client, ENTRY, place)
        return pair.sent_bytes - before

    assert asyncio.run(twice()) < 100


def test_an_interrupted_fetch_goes_on_where_it_ended(root: Path, tmp_path: Path) -> None:
    pair = Pair(root)
    place = tmp_path / "flight.sqlite"
    part = place.with_name(place.name + PART_SUFFIX)
    part.write_bytes(CONTENT[:20_000])
    asyncio.run(fetch_file(pair.client, ENTRY, place))
    assert place.read_bytes() == CONTENT
    assert pair.sent_bytes < 11_500
    assert not part.exists()


def test_a_part_of_another_file_is_noticed_and_fetched_anew(root: Path, tmp_path: Path) -> None:
    pair = Pair(root)
    place = tmp_path / "flight.sqlite"
    place.with_name(place.name + PART_SUFFIX).write_bytes(b"x" * 20_000)
    asyncio.run(fetch_file(pair.client, ENTRY, place))
    assert place.read_bytes() == CONTENT


def test_a_file_that_is_not_there_is_named(root: Path, tmp_path: Path) -> None:
    entry = RemoteEntry(path="/flight_log_1/nothing", size=5)
    with pytest.raises(LinkError, match="nothing: file not found"):
        asyncio.run(fetch_file(Pair(root).client, entry, tmp_path / "x"))


def test_a_drone_that_is_silent_is_named(root: Path) -> None:
    with pytest.raises(LinkError, match="no answer"):
        asyncio.run(Pair(root, loss=1.0).client.list_directory("/"))


def test_the_checksum_of_a_file_here_is_that_of_the_drone(root: Path) -> None:
    there = asyncio.run(Pair(root).client.checksum(ENTRY.path))
    assert there == file_checksum(root / "flight_log_1" / "flight.sqlite")


@pytest.mark.parametrize(
    "line",
    [
        b"F../../.profile\t5",
        b"D..",
        b"F/etc/cron.d/x\t5",
        b"Fflight\tmany",
        b"D",
        b"Fa\x1b[2Jb\t5",
    ],
)
def test_names_that_lead_elsewhere_or_steer_a_terminal_are_refused(line: bytes) -> None:
    client = rogue(lambda path, offset: [line])
    with pytest.raises(LinkError, match="no file's name and size"):
        asyncio.run(client.list_directory("/"))


def rogue(lines: Callable[[str, int], list[bytes]]) -> FileClient:
    """A client whose drone answers each listing with the lines for a path and an offset."""

    def answer(payload: bytes) -> None:
        asked = FtpPacket.decode(payload)
        listed = lines(asked.data.decode(), asked.offset)
        listing = FtpPacket(
            sequence=asked.sequence + 1,
            session=asked.session,
            opcode=Opcode.ACK if listed else Opcode.NAK,
            request_opcode=asked.opcode,
            data=b"".join(line + b"\0" for line in listed)
            or bytes([FtpError.END_OF_FILE.value]),
        )
        client.receive(listing.encode())

    client = FileClient(answer, lambda: 0)
    return client


def test_directories_without_end_are_left_out_and_counted() -> None:
    asked: list[str] = []

    def deep(path: str, offset: int) -> list[bytes]:
        asked.append(path)
        return [] if offset else [b"Dmore", b"Flog\t5"]

    tree = asyncio.run(rogue(deep).tree("/"))
    assert len(tree.files) == MOST_DEEP
    assert tree.left_out == 1
    assert max(path.count("/more") for path in asked) == MOST_DEEP - 1


def test_directories_that_double_at_each_level_end_at_the_most_entries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("uavrt.ground.fetch.MOST_ENTRIES", 90)
    tree = asyncio.run(
        rogue(lambda path, offset: [] if offset else [b"Da", b"Db", b"Ff\t5"]).tree("/")
    )
    assert len(tree.files) == 30
    assert tree.left_out > 3


def test_a_path_too_long_to_be_asked_for_is_left_out() -> None:
    endless = rogue(lambda path, offset: [] if offset else [b"D" + b"long" * 40, b"Ff\t5"])
    tree = asyncio.run(endless.tree("/"))
    assert len(tree.files) == 2
    assert tree.left_out == 1
    with pytest.raises(LinkError, match="longer than a request"):
        asyncio.run(rogue(lambda path, offset: []).list_directory("/" + "long" * 60))


def test_a_directory_without_end_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("uavrt.ground.fetch.MOST_ENTRIES", 300)
    client = rogue(lambda path, offset: [f"Ff{offset + n}\t5".encode() for n in range(9)])
    with pytest.raises(LinkError, match="more than 300 files"):
        asyncio.run(client.tree("/"))
