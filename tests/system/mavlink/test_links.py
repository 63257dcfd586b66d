"""Links over real TCP and a pseudo-terminal, in real time."""

import asyncio
import contextlib
import math
import os
import pty
import socket
from collections.abc import Callable
from functools import partial

import pytest
from some import some
from tests.unit.mavlink.test_links import FRAME, PING
from until import until_async as until

from uavrt.link.mavlink.component import Handlers
from uavrt.link.mavlink.frame import Frame
from uavrt.link.mavlink.links.transport import open_link
from uavrt.link.mavlink.links.udp import UdpLink
from uavrt.link.mavlink.mavlink_connection import Connection


async def test_a_tcp_link_talks_and_connects_again_when_the_other_side_restarts() -> None:
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


def test_a_serial_link_talks_through_a_terminal_and_comes_back_after_a_hang_up(
    tmp_path: os.PathLike[str],
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


async def test_a_serial_link_that_is_not_drained_drops_whole_frames_and_counts() -> None:
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


async def test_a_serial_link_reports_how_long_a_frame_would_wait() -> None:
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


async def test_a_command_of_motion_does_not_queue_behind_what_waits_for_a_serial_port() -> None:
    master, slave = pty.openpty()
    connection = Connection(Handlers(attitude=print, position=print, tunnel=print), lambda: 0)
    serving = asyncio.create_task(connection.serve(0, f"serial://{os.ttyname(slave)}:57600"))
    await until(lambda: connection.link is not None)
    link = some(connection.link)
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


async def test_a_command_of_motion_does_not_queue_behind_what_a_peer_leaves_unread() -> None:
    """The system takes it all the same, and sends it when the peer reads again."""
    server = socket.create_server(("127.0.0.1", 0))
    server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    connection = Connection(Handlers(attitude=print, position=print, tunnel=print), lambda: 0)
    port = server.getsockname()[1]
    serving = asyncio.create_task(connection.serve(0, f"tcp://127.0.0.1:{port}"))
    peer, _ = await asyncio.to_thread(server.accept)
    await until(lambda: connection.link is not None)
    link = some(connection.link)
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
async def test_a_frame_that_its_handler_fails_at_is_counted_and_reading_goes_on(
    kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
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
    logged = capsys.readouterr().err
    assert logged.count("skipped after an unexpected error") == 2
    assert "77 is not a valid CommandId" in logged
