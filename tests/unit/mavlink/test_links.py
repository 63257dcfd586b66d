"""Links over real sockets and a pseudo-terminal, and what they say when they cannot open."""

import asyncio
import contextlib
import errno
import math
import os
import pty
import socket
from collections.abc import Awaitable, Callable
from functools import partial

import pytest
import serial

from uavrt.errors import ConfigError, LinkError
from uavrt.mavlink import (
    Connection,
    Frame,
    FrameWriter,
    Handlers,
    open_link,
    parse_address,
)
from uavrt.mavlink import dialect as d
from uavrt.mavlink.stream import TcpLink
from uavrt.mavlink.udp import UdpLink

Until = Callable[..., Awaitable[None]]
PING = d.Ping(time_usec=1, seq=2, target_system=0, target_component=0)
FRAME = FrameWriter(1, 1).encode(PING)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "udpin://",
        "udpin://127.0.0.1",
        "udpout://127.0.0.1:0",
        "udp://127.0.0.1:14540",
        "udpin://127.0.0.1:99999",
        "tcp://127.0.0.1:x",
        "serial://ttyUSB0:57600",
        "serial:///dev/ttyUSB0:fast",
        "serial:///dev/ttyUSB0:0",
        "/dev/ttyUSB0",
    ],
)
def test_an_address_that_is_none_is_refused_with_the_forms(text: str) -> None:
    with pytest.raises(ConfigError, match=r"serial:///dev/ttyUSB0:57600"):
        parse_address(text)


@pytest.mark.parametrize(
    "text",
    [
        "udpin://127.0.0.1:14540",
        "udpout://[::1]:14550",
        "tcp://drone.local:5760",
        "serial:///dev/ttyAMA0:921600",
    ],
)
def test_an_address_reads_back_as_it_was_written(text: str) -> None:
    assert str(parse_address(text)) == text


def test_a_serial_address_without_a_rate_has_the_usual_one() -> None:
    assert parse_address("serial:///dev/ttyUSB0").baud == 57_600


def test_two_udp_links_talk_and_count(until: Until) -> None:
    async def main() -> None:
        heard: list[Frame] = []
        answered: list[Frame] = []
        server = await open_link("udpin://127.0.0.1:0", heard.append)
        assert isinstance(server, UdpLink)
        assert not server.send(FRAME), "nobody to send to yet"
        client = await open_link(f"udpout://127.0.0.1:{server.local_port}", answered.append)
        client.send(FRAME + b"rubbish")
        client.send(FRAME[:-1] + bytes([FRAME[-1] ^ 1]))
        await until(lambda: heard and server.counters.bad_crc)
        assert heard[0].message() == PING
        assert server.send(FRAME)
        await until(lambda: answered)
        counters = server.counters
        assert (counters.received, counters.sent, counters.dropped) == (1, 1, 1)
        assert counters.bad_crc == 1
        await client.close()
        await server.close()

    asyncio.run(main())


def test_a_udp_port_in_use_is_named_with_its_remedy() -> None:
    async def main(port: int) -> None:
        with pytest.raises(LinkError, match=rf"{port}.*in use.*ss -ulpn"):
            await open_link(f"udpin://127.0.0.1:{port}", lambda frame: None)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        asyncio.run(main(taken.getsockname()[1]))


def test_a_tcp_link_talks_and_connects_again_when_the_other_side_restarts(
    until: Until,
) -> None:
    async def main() -> None:
        heard: list[Frame] = []
        arrived: list[bytes] = []
        writers: list[asyncio.StreamWriter] = []

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writers.append(writer)
            writer.write(FRAME[:5])
            await writer.drain()
            writer.write(FRAME[5:])
            arrived.append(await reader.read(len(FRAME)))

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        link = await open_link(f"tcp://127.0.0.1:{port}", heard.append)
        assert link.send(FRAME)
        await until(lambda: len(heard) == 1 and arrived)
        assert arrived == [FRAME]
        writers[0].close()
        await until(lambda: len(heard) == 2)
        assert link.counters.reconnects == 1
        await link.close()
        writers[1].close()
        server.close()
        await server.wait_closed()

    asyncio.run(main())


def test_a_tcp_address_where_nobody_listens_is_named_with_its_remedy() -> None:
    async def main(port: int) -> None:
        with pytest.raises(LinkError, match=r"[Cc]onnect.*the other side is listening"):
            await open_link(f"tcp://127.0.0.1:{port}", lambda frame: None)

    with socket.socket() as unheard:
        unheard.bind(("127.0.0.1", 0))
        asyncio.run(main(unheard.getsockname()[1]))


def test_a_serial_link_talks_through_a_terminal_and_comes_back_after_a_hang_up(
    until: Until, tmp_path: os.PathLike[str]
) -> None:
    device = os.path.join(tmp_path, "tty")

    def plug() -> int:
        master, slave = pty.openpty()
        if os.path.lexists(device):
            os.unlink(device)
        os.symlink(os.ttyname(slave), device)
        os.close(slave)
        os.set_blocking(master, False)
        return master

    def read(master: int) -> bytes:
        try:
            return os.read(master, 4096)
        except OSError:
            return b""

    async def main() -> None:
        heard: list[Frame] = []
        master = plug()
        link = await open_link(f"serial://{device}:57600", heard.append)
        os.write(master, b"noise" + FRAME[:7])
        os.write(master, FRAME[7:])
        await until(lambda: len(heard) == 1)
        assert link.counters.skipped_bytes == 5
        assert link.send(FRAME)
        await until(lambda: read(master) == FRAME)
        os.close(master)
        await until(lambda: not link.send(FRAME))
        master = plug()
        await until(lambda: link.counters.reconnects == 1)
        os.write(master, FRAME)
        await until(lambda: len(heard) == 2)
        await link.close()
        os.close(master)

    asyncio.run(main())


def test_a_serial_link_that_nobody_drains_drops_whole_frames_and_counts(
    until: Until,
) -> None:
    async def main() -> None:
        master, slave = pty.openpty()
        link = await open_link(f"serial://{os.ttyname(slave)}:57600", lambda frame: None)
        os.set_blocking(master, False)
        while link.counters.dropped == 0:
            link.send(FRAME)
        sent = link.counters.sent
        collected = bytearray()

        def drain() -> bool:
            with contextlib.suppress(BlockingIOError):
                collected.extend(os.read(master, 65536))
            return len(collected) == sent * len(FRAME)

        await until(drain)
        assert bytes(collected) == FRAME * sent
        await link.close()
        os.close(master)
        os.close(slave)

    asyncio.run(main())


def test_a_serial_link_tells_how_long_a_frame_would_wait(until: Until) -> None:
    async def main() -> None:
        master, slave = pty.openpty()
        link = await open_link(f"serial://{os.ttyname(slave)}:57600", lambda frame: None)
        os.set_blocking(master, False)
        assert link.delay_s == 0.0
        while link.counters.dropped == 0:
            link.send(FRAME)
        assert link.delay_s > 0.3

        def drain() -> bool:
            with contextlib.suppress(BlockingIOError):
                os.read(master, 65536)
            return link.delay_s == 0.0

        await until(drain)
        await link.close()
        os.close(master)
        os.close(slave)

    asyncio.run(main())


def test_a_command_of_motion_does_not_queue_behind_what_waits_for_a_serial_port(
    until: Until,
) -> None:
    async def main() -> None:
        master, slave = pty.openpty()
        connection = Connection(
            Handlers(attitude=print, position=print, tunnel=print), lambda: 0
        )
        serving = asyncio.create_task(
            connection.serve(0, f"serial://{os.ttyname(slave)}:57600")
        )
        await until(lambda: connection.link is not None)
        link = connection.link
        assert link is not None
        connection.command_autopilot(PING)
        assert link.counters.sent == 1
        assert connection.commands_leave
        while link.delay_s < 0.3:
            link.send(FRAME)
        assert not connection.commands_leave
        before = link.counters.sent
        connection.command_autopilot(PING)
        assert link.counters.sent == before
        assert connection.counters()["commands_not_sent"] == 1
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        os.close(master)
        os.close(slave)

    asyncio.run(main())


def test_a_command_of_motion_does_not_queue_behind_what_a_tcp_peer_leaves_unread(
    until: Until,
) -> None:
    """The system takes it all the same, and sends it when the peer reads again."""

    async def main() -> None:
        server = socket.create_server(("127.0.0.1", 0))
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection = Connection(
            Handlers(attitude=print, position=print, tunnel=print), lambda: 0
        )
        port = server.getsockname()[1]
        serving = asyncio.create_task(connection.serve(0, f"tcp://127.0.0.1:{port}"))
        peer, _ = await asyncio.to_thread(server.accept)
        await until(lambda: connection.link is not None)
        link = connection.link
        assert link is not None
        connection.command_autopilot(PING)
        assert link.counters.sent == 1

        def waits() -> bool:
            link.send(FRAME * 20)
            return link.delay_s > 0.3

        await until(waits)
        assert link.delay_s < math.inf, "asyncio itself holds nothing back"
        before = link.counters.sent
        connection.command_autopilot(PING)
        assert link.counters.sent == before
        assert connection.counters()["commands_not_sent"] == 1
        peer.setblocking(False)

        def drained() -> bool:
            with contextlib.suppress(BlockingIOError):
                peer.recv(1 << 16)
            return link.delay_s == 0.0

        await until(drained)
        connection.command_autopilot(PING)
        assert link.counters.sent == before + 1
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        peer.close()
        server.close()

    asyncio.run(main())


def test_bytes_that_a_tcp_peer_does_not_acknowledge_are_not_kept_for_long() -> None:
    async def main() -> None:
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
            link = await open_link(f"tcp://127.0.0.1:{port}", lambda frame: None)
            assert isinstance(link, TcpLink)
            assert link.gives_up_after_s == 3.0
            await link.close()

    asyncio.run(main())


@pytest.mark.parametrize(
    ("text", "alone"),
    [
        ("udpin://127.0.0.1:14540", True),
        ("udpout://[::1]:14550", True),
        ("tcp://localhost:5760", True),
        ("udpin://0.0.0.0:14540", False),
        ("udpout://192.168.1.2:14550", False),
        ("tcp://drone.local:5760", False),
        ("serial:///dev/ttyAMA0:921600", False),
    ],
)
def test_an_address_tells_whether_only_this_computer_is_behind_it(
    text: str, alone: bool
) -> None:
    assert parse_address(text).is_loopback is alone


def open_serial_error(device: str) -> LinkError:
    async def main() -> LinkError:
        with pytest.raises(LinkError) as caught:
            await open_link(f"serial://{device}:57600", lambda frame: None)
        return caught.value

    return asyncio.run(main())


def test_a_missing_serial_port_is_named_with_those_present() -> None:
    error = open_serial_error("/dev/ttyNone99")
    assert "no such serial port" in error.message
    assert "ports present" in str(error)


def test_a_serial_port_held_by_another_program_is_named_as_such() -> None:
    master, slave = pty.openpty()
    with serial.Serial(os.ttyname(slave), exclusive=True):
        error = open_serial_error(os.ttyname(slave))
    assert "in use" in error.message
    os.close(master)
    os.close(slave)


def test_a_serial_port_without_permission_points_to_the_dialout_group() -> None:
    from uavrt.mavlink.stream import _serial_error

    error = _serial_error(
        parse_address("serial:///dev/ttyUSB0"), PermissionError(errno.EACCES, "denied")
    )
    assert "dialout" in str(error)


class Stumbling:
    """A handler that fails at its first frames."""

    def __init__(self, times: int) -> None:
        self.left = times
        self.heard: list[Frame] = []

    def __call__(self, frame: Frame) -> None:
        if self.left:
            self.left -= 1
            raise ValueError("77 is not a valid CommandId")
        self.heard.append(frame)


@pytest.mark.parametrize("kind", ["udp", "tcp", "serial"])
def test_a_frame_that_its_handler_fails_at_is_counted_and_reading_goes_on(
    kind: str, until: Until, capsys: pytest.CaptureFixture[str]
) -> None:
    async def main() -> None:
        handler = Stumbling(2)
        async with contextlib.AsyncExitStack() as stack:
            if kind == "udp":
                link = await open_link("udpin://127.0.0.1:0", handler)
                assert isinstance(link, UdpLink)
                far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                stack.callback(far.close)
                far.connect(("127.0.0.1", link.local_port))
                say: Callable[[bytes], object] = far.send
            elif kind == "tcp":
                server = socket.create_server(("127.0.0.1", 0))
                stack.callback(server.close)
                port = server.getsockname()[1]
                link = await open_link(f"tcp://127.0.0.1:{port}", handler)
                far, _ = server.accept()
                stack.callback(far.close)
                say = far.send
            else:
                master, slave = pty.openpty()
                stack.callback(os.close, master)
                link = await open_link(f"serial://{os.ttyname(slave)}:57600", handler)
                os.close(slave)
                say = partial(os.write, master)

            say(FRAME)
            await until(lambda: link.counters.faults == 1)
            say(FRAME)
            await until(lambda: link.counters.faults == 2)
            say(FRAME)
            await until(lambda: handler.heard)
            assert link.counters.received == 3
            assert link.health()["link_faults"] == 2
            await link.close()

    asyncio.run(main())
    logged = capsys.readouterr().err
    assert logged.count("frame not handled") == 2
    assert "77 is not a valid CommandId" in logged
