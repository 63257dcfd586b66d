"""`uavrt fetch` against the drone's file server, over a link that loses."""

import asyncio
import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import made
import numpy as np
import pytest
from virtual_time import START_S, VirtualClock

from uavrt.cli.system.fetch import _list_samples, _wanted
from uavrt.core.errors import LinkError, RecordingError
from uavrt.flight.flight_order import flights_in_order, note_flight
from uavrt.flight.samples.sample_file import SampleFile
from uavrt.ground.fetch.flight_list import MOST_NOTED, drone_flights
from uavrt.ground.fetch.ftp_client import (
    MOST_ENTRIES,
    MOST_NESTED,
    PART_SUFFIX,
    STALL_NS,
    FileClient,
    RemoteEntry,
    fetch_file,
    file_checksum,
    require_room,
)
from uavrt.ground.fetch.sample_files import BAND, CHANNELS
from uavrt.link.mavlink.dialect import FileTransferProtocol
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.services.ftp_files import FileTree
from uavrt.link.mavlink.services.ftp_server import FileServer
from uavrt.link.mavlink.services.ftp_wire import FtpError, FtpPacket, Opcode

CONTENT = random.Random(6).randbytes(30_011)
START_NS = 1_777_615_200_000_000_000
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


@pytest.mark.parametrize(("of_it", "most_bytes"), [(True, 11_500), (False, 50_000)])
def test_an_interrupted_fetch_goes_on_where_it_ended_but_not_with_a_part_of_another_file(
    root: Path, tmp_path: Path, of_it: bool, most_bytes: int
) -> None:
    pair = Pair(root)
    place = tmp_path / "flight.sqlite"
    part = place.with_name(place.name + PART_SUFFIX)
    part.write_bytes(CONTENT[:20_000] if of_it else b"x" * 20_000)
    asyncio.run(fetch_file(pair.client, ENTRY, place))
    assert place.read_bytes() == CONTENT
    assert pair.sent_bytes < most_bytes
    assert not part.exists()


def test_a_file_that_is_not_there_is_named(root: Path, tmp_path: Path) -> None:
    entry = RemoteEntry(path="/flight_log_1/nothing", size=5)
    with pytest.raises(LinkError, match="nothing: file not found"):
        asyncio.run(fetch_file(Pair(root).client, entry, tmp_path / "x"))


def test_a_drone_that_is_silent_is_named(root: Path) -> None:
    with pytest.raises(LinkError, match="did not answer"):
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
    with pytest.raises(LinkError, match="not a name with a size"):
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


class Rogue:
    """Answers in the drone's place; `bursts` gives what comes of each one asked for."""

    def __init__(self, size: int, bursts: Callable[[int], list[FtpPacket]]) -> None:
        self.client = FileClient(self._ask, lambda: 0)
        self._size, self._bursts = size, bursts
        self.asked = 0

    def _ask(self, payload: bytes) -> None:
        self.asked += 1
        asked = FtpPacket.decode(payload)
        answers = [
            FtpPacket(
                sequence=asked.sequence + 1,
                opcode=Opcode.ACK,
                request_opcode=asked.opcode,
                data=self._size.to_bytes(4, "little"),
            )
        ]
        if asked.opcode in (Opcode.BURST_READ_FILE, Opcode.READ_FILE):
            answers = self._bursts(asked.offset)
        for answer in answers:
            asyncio.get_running_loop().call_soon(
                self.client.receive,
                replace(
                    answer, request_opcode=asked.opcode, sequence=asked.sequence + 1
                ).encode(),
            )


def piece(offset: int, data: bytes) -> FtpPacket:
    return FtpPacket(sequence=0, opcode=Opcode.ACK, offset=offset, data=data)


EVIL = {
    "nothing, again and again": lambda offset: [piece(offset, b"")] * 3,
    "the same place for ever": lambda offset: [piece(0, b"x" * 239)] * 3,
    "a byte at a time": lambda offset: [piece(offset, b"x")],
    "2 kB a minute": lambda offset: [piece(offset, b"x" * 30)],
    "bytes that lie over each other": lambda offset: [
        piece(offset + 2, b"y" * 9),
        piece(offset, b"x" * 5),
    ],
    "far beyond the end": lambda offset: [piece(offset + 2_000_000_000, b"x" * 239)],
    "answers to what was not asked": lambda offset: [
        FtpPacket(sequence=0, opcode=Opcode.NAK, data=bytes([99]))
    ],
}


GETTING_ON = ("a byte at a time", "2 kB a minute", "bytes that lie over each other")
MINUTE_S = STALL_NS / 1e9


def slowed(client: FileClient, clock: VirtualClock, each_s: float) -> FileClient:
    """Let each request of a client take its time."""
    send = client._send

    def late(payload: bytes) -> None:
        clock.now_s += each_s
        send(payload)

    client._send = late
    return client


@pytest.mark.parametrize("evil", EVIL)
def test_a_rogue_that_does_not_get_on_is_given_up_after_a_minute_at_most(
    evil: str, tmp_path: Path, clock_of_test: VirtualClock
) -> None:
    client = slowed(Rogue(1_000_000, EVIL[evil]).client, clock_of_test, 0.3)
    entry = RemoteEntry(path="/flight_log_1/flight.sqlite", size=1_000_000)
    with pytest.raises((LinkError, RecordingError)) as caught:
        asyncio.run(fetch_file(client, entry, tmp_path / "flight.sqlite"))
    # The minute and the tries that follow it.
    assert clock_of_test.now_s - START_S < 2.5 * MINUTE_S
    assert ("has stalled" in str(caught.value)) == (evil in GETTING_ON)
    assert not (tmp_path / "flight.sqlite").exists()


def test_pieces_that_lie_over_each_other_are_put_together_right(tmp_path: Path) -> None:
    def bursts(offset: int) -> list[FtpPacket]:
        pieces = [(offset, 100), (offset + 50, 100), (offset + 150, 60)]
        return [piece(start, CONTENT[start : start + n]) for start, n in pieces]

    drone = Rogue(2_000, bursts)
    got = bytearray()

    async def keep(data: bytes) -> None:
        got.extend(data)

    asyncio.run(drone.client.read("/a", keep))
    assert bytes(got) == CONTENT[:2_000]


def test_a_flood_of_answers_takes_bounded_memory() -> None:
    client = FileClient(lambda payload: None, lambda: 0)
    for _ in range(10_000):
        client.receive(piece(0, b"x").encode())
    assert client._replies.qsize() == 4096
    assert client.dropped == 10_000 - 4096


def test_a_file_that_is_much_longer_than_listed_is_not_read(tmp_path: Path) -> None:
    drone = Rogue(4_000_000_000, lambda offset: [piece(offset, b"x" * 239)])
    entry = RemoteEntry(path="/a", size=5)
    with pytest.raises(LinkError, match="the drone listed 5"):
        asyncio.run(fetch_file(drone.client, entry, tmp_path / "a"))
    assert drone.asked == 1


def test_what_the_disk_here_has_no_room_for_is_not_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=150_000_000))
    drone = Rogue(60_000_000, lambda offset: [piece(offset, b"x" * 239)])
    entry = RemoteEntry(path="/a", size=60_000_000)
    with pytest.raises(RecordingError, match="60 MB are needed"):
        asyncio.run(fetch_file(drone.client, entry, tmp_path / "new" / "a"))
    with pytest.raises(RecordingError, match="50 MB are free"):
        require_room([entry], tmp_path / "new", samples=False)
    monkeypatch.undo()
    with pytest.raises(RecordingError, match="recorded samples has at most 2 GB"):
        require_room([replace(entry, size=3_000_000_000)], tmp_path, samples=False)


def test_a_list_that_comes_a_name_at_a_time_is_given_up(clock_of_test: VirtualClock) -> None:
    client = rogue(lambda path, offset: [f"Ff{offset}\t5".encode()])
    slowed(client, clock_of_test, 2.5)
    with pytest.raises(LinkError, match="has stalled"):
        asyncio.run(client.tree("/"))
    assert clock_of_test.now_s - START_S < 2 * MINUTE_S


def fetched(root: Path, place: Path, name: str) -> bool:
    entry = RemoteEntry(
        path=f"/flight_log_1/{name}", size=(root / "flight_log_1" / name).stat().st_size
    )
    return asyncio.run(fetch_file(Pair(root).client, entry, place))


def test_a_file_of_another_flight_with_the_same_name_stays(root: Path, tmp_path: Path) -> None:
    place = tmp_path / "flight.sqlite"
    place.write_bytes(b"ours")
    assert fetched(root, place, "flight.sqlite")
    assert place.read_bytes() == b"ours"
    other = tmp_path / "flight.sqlite.other-1"
    assert other.read_bytes() == CONTENT
    assert not fetched(root, place, "flight.sqlite")
    assert sorted(tmp_path.glob("flight.sqlite*")) == [place, other]


def test_a_log_that_has_grown_takes_the_place_of_what_was_here(
    root: Path, tmp_path: Path
) -> None:
    place = tmp_path / "pulse_pose_log.txt"
    there = root / "flight_log_1" / "pulse_pose_log.txt"
    for content in ("one\n", "one\ntwo\n"):
        there.write_text(content)
        assert fetched(root, place, "pulse_pose_log.txt")
        assert place.read_text() == content
    there.write_text("another\nflight\n")
    assert fetched(root, place, "pulse_pose_log.txt")
    assert place.read_text() == "one\ntwo\n"


def database(directory: Path, pulses: range, start_ns: int = 10**18) -> Path:
    info = made.flight_info(directory, start_time_ns=start_ns)
    made.flight(info, pulses=[made.pulse(10**18 + n * 10**9) for n in pulses])
    return directory / "flight.sqlite"


def description(directory: Path, *starts_s: float, rate_hz: float = 3750.0) -> Path:
    """That of samples with gaps: else samples were added here without the gaps before them."""
    file = SampleFile(
        directory / "band",
        sample_rate_hz=rate_hz,
        center_frequency_hz=148.7e6,
        description="a flight",
    )
    for number, start_s in enumerate(starts_s):
        samples = np.full(100, 0.5, np.complex64)
        file.append(samples, number * 50_000, START_NS + round(start_s * 1e9))
    file.close()
    return file.metadata_path


def database_here(directory: Path) -> Path:
    return database(directory, range(5))


def description_here(directory: Path) -> Path:
    return description(directory, 0.0, 13.3)


@pytest.mark.parametrize(
    ("here", "there", "later"),
    [
        (database_here, lambda drone: database(drone, range(9)), True),
        (database_here, lambda drone: database(drone, range(1, 9)), False),
        (database_here, lambda drone: database(drone, range(9), 10**18 + 1), False),
        (database_here, lambda drone: damaged(database(drone, range(9)), 100), False),
        (description_here, lambda drone: description(drone, 0.0, 13.3, 30.0), True),
        (description_here, lambda drone: description(drone, 0.02, 13.3), True),
        (description_here, lambda drone: description(drone, 60.0, 73.3, 90.0), False),
        (
            description_here,
            lambda drone: description(drone, 0.0, 13.3, 30.0, rate_hz=7500.0),
            False,
        ),
        (description_here, lambda drone: damaged(description(drone, 0.0, 13.3, 30.0)), False),
    ],
)
def test_a_file_is_replaced_by_a_later_state_of_the_same_alone(
    root: Path,
    tmp_path: Path,
    here: Callable[[Path], Path],
    there: Callable[[Path], Path],
    later: bool,
) -> None:
    shutil.rmtree(root / "flight_log_1")
    place, new = here(tmp_path / "here"), there(root / "flight_log_1")
    before = place.read_bytes()
    assert fetched(root, place, new.name)
    assert place.read_bytes() == (new.read_bytes() if later else before)
    assert place.with_name(f"{place.name}.other-1").exists() != later


def damaged(path: Path, kept: int = -40) -> Path:
    """Cut a file off, and put other bytes in place of the rest."""
    path.write_bytes(path.read_bytes()[:kept] + b"\xff" * 3000)
    return path


def test_directories_without_end_are_left_out_and_counted() -> None:
    asked: list[str] = []

    def deep(path: str, offset: int) -> list[bytes]:
        asked.append(path)
        return [] if offset else [b"Dmore", b"Flog\t5"]

    tree = asyncio.run(rogue(deep).tree("/"))
    assert len(tree.files) == MOST_NESTED
    assert tree.left_out == 1
    assert max(path.count("/more") for path in asked) == MOST_NESTED - 1


async def test_directories_that_multiply_at_each_level_end_at_the_most_entries() -> None:
    within = [*(f"D{number}".encode() for number in range(19)), b"Ff\t5"]
    tree = await rogue(lambda path, offset: within[offset : offset + 9]).tree("/")
    assert len(tree.files) == MOST_ENTRIES // 20
    assert tree.left_out > 3


def test_a_path_too_long_to_be_asked_for_is_left_out() -> None:
    endless = rogue(lambda path, offset: [] if offset else [b"D" + b"long" * 40, b"Ff\t5"])
    tree = asyncio.run(endless.tree("/"))
    assert len(tree.files) == 2
    assert tree.left_out == 1
    with pytest.raises(LinkError, match="too long to be requested"):
        asyncio.run(rogue(lambda path, offset: []).list_directory("/" + "long" * 60))


async def test_a_directory_without_end_is_refused() -> None:
    client = rogue(lambda path, offset: [f"Ff{offset + n}\t5".encode() for n in range(9)])
    with pytest.raises(LinkError, match=f"more than {MOST_ENTRIES} files"):
        await client.tree("/")


def test_samples_come_only_when_asked_for_and_their_size_is_told(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = root / "flight_log_1"
    (flight / "iq" / "channels").mkdir(parents=True)
    (flight / "iq" / "band_1.sigmf-data").write_bytes(bytes(3_000_000))
    (flight / "iq" / "channels" / "channel_1_Hz_0001.sigmf-data").write_bytes(bytes(900_000))

    def wanted(left: tuple[str, ...]) -> list[str]:
        found = asyncio.run(_wanted(Pair(root).client, "flight_log_1", left))
        return [one.path for one in found if "/iq/" in one.path]

    channel = "/flight_log_1/iq/channels/channel_1_Hz_0001.sigmf-data"
    assert wanted((BAND, CHANNELS)) == []
    told = " ".join(capsys.readouterr().err.split())
    assert "0.9 MB of samples stay on the drone: fetch them with --samples, by Wi-Fi" in told
    assert "about 2 s, by a telemetry radio in about 5 minutes" in told
    assert "3.0 MB of samples stay on the drone: fetch them with --all" in told
    assert wanted((BAND,)) == [channel]
    assert wanted(()) == [channel, "/flight_log_1/iq/band_1.sigmf-data"]
    asyncio.run(_list_samples(Pair(root).client, "flight_log_1"))
    told = capsys.readouterr().out
    assert "900000  channels of the tags (--samples)" in told
    assert "3000000  other samples (--all)" in told


def test_the_newest_flight_is_the_one_flown_last_whatever_the_clock_said(
    tmp_path: Path,
) -> None:
    stamps = ("2025_06_01_10_00_00", "2026_06_01_10_00_00", "1970_01_01_00_00_09")
    flown = [tmp_path / f"flight_log_{stamp}" for stamp in stamps]
    for flight in flown:
        flight.mkdir()
        (flight / "flight.sqlite").write_bytes(b"x")
    of_names = [flight.name for flight in sorted(flown)]
    assert asyncio.run(drone_flights(Pair(tmp_path).client)) == of_names

    # Longer than what is read of it: the flights of long ago are no longer there.
    order = tmp_path / "flights_in_order.txt"
    order.write_text("flight_log_1999_01_01_00_00_00\n" * (MOST_NOTED // 20))
    for flight in flown:
        note_flight(flight)
    pair = Pair(tmp_path, loss=0.1)
    in_order = asyncio.run(drone_flights(pair.client))
    assert in_order == [flight.name for flight in flights_in_order(tmp_path)]
    assert in_order[-1] == flown[-1].name
    # What the page on the drone received is no flight of the drone's.
    (tmp_path / f"{in_order[-1]}_ground").mkdir()
    assert asyncio.run(drone_flights(Pair(tmp_path).client)) == in_order
    assert pair.sent_bytes < 2 * MOST_NOTED
    (newest,) = asyncio.run(_wanted(Pair(tmp_path).client, "", ()))
    assert newest.path == f"/{flown[-1].name}/flight.sqlite"
