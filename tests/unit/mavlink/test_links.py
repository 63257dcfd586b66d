"""Links over real sockets and a pseudo-terminal, and what they say when they cannot open."""

import asyncio
import errno
import os
import pty
import socket

import pytest
import serial
from until import until_async as until

from uavrt.core.errors import ConfigError, LinkError
from uavrt.link.mavlink import dialect as d
from uavrt.link.mavlink.frame import Frame, FrameWriter
from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.mavlink.links.stream_links import TcpLink
from uavrt.link.mavlink.links.transport import open_link
from uavrt.link.mavlink.links.udp import MAX_PEERS, UdpLink

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


def test_a_serial_address_without_a_rate_has_the_usual_one() -> None:
    assert parse_address("serial:///dev/ttyUSB0").baud == 57_600


async def test_two_udp_links_talk_and_count() -> None:
    heard: list[Frame] = []
    answered: list[Frame] = []
    server = await open_link("udpin://127.0.0.1:0", heard.append)
    assert isinstance(server, UdpLink)
    assert not server.send(FRAME), "no peer to send to yet"
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


def test_a_udp_port_in_use_is_named_with_its_remedy() -> None:
    async def main(port: int) -> None:
        with pytest.raises(LinkError, match=rf"{port}.*in use.*ss -ulpn"):
            await open_link(f"udpin://127.0.0.1:{port}", lambda frame: None)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        asyncio.run(main(taken.getsockname()[1]))


def test_a_tcp_address_where_nobody_listens_is_named_with_its_remedy() -> None:
    async def main(port: int) -> None:
        with pytest.raises(LinkError, match=r"[Cc]onnect.*at the other end is running"):
            await open_link(f"tcp://127.0.0.1:{port}", lambda frame: None)

    with socket.socket() as unheard:
        unheard.bind(("127.0.0.1", 0))
        asyncio.run(main(unheard.getsockname()[1]))


async def test_bytes_that_a_tcp_peer_does_not_acknowledge_are_not_kept_for_long() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        link = await open_link(f"tcp://127.0.0.1:{port}", lambda frame: None)
        assert isinstance(link, TcpLink)
        assert link._writer is not None
        connected = link._writer.get_extra_info("socket")
        assert connected.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 3000
        await link.close()


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
def test_an_address_reads_back_and_tells_if_it_is_loopback(text: str, alone: bool) -> None:
    assert str(parse_address(text)) == text
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
    from uavrt.link.mavlink.links.stream_links import _serial_error

    error = _serial_error(
        parse_address("serial:///dev/ttyUSB0"), PermissionError(errno.EACCES, "denied")
    )
    assert "dialout" in str(error)


def test_the_peers_known_longest_stay_however_many_ports_speak() -> None:
    link = UdpLink(parse_address("udpin://127.0.0.1:14540"), lambda frame: None)
    autopilot = ("127.0.0.1", 14_580)
    link._remember(autopilot)
    for port in range(20_000, 22_000):
        link._remember(("192.0.2.7", port))
        assert autopilot in link._peers
        assert ("192.0.2.7", port) in link._peers, "the newest one is answered, too"
    assert len(link._peers) == MAX_PEERS
