"""Links over byte streams: TCP and serial ports."""

import asyncio
import errno
import math
import os
import socket
import struct
import sys
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import serial
from serial.tools import list_ports

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import LinkError, os_errors_as
from uavrt.core.log import get_logger
from uavrt.link.mavlink.links.address import Address
from uavrt.link.mavlink.links.mavlink_link import MAX_PENDING, RETRY_S, Link, Parser

log = get_logger()

READ_SIZE = 4096
BITS_PER_BYTE = 10
"""Number of bits that a byte takes on a serial line, with start and stop bit."""
SERIAL_PENDING = 2048
"""Largest number of bytes that wait to be sent by a serial port: 0.36 s at 57 600 baud."""
SIOCOUTQ = 0x5411
"""Linux ioctl number to read the number of unacknowledged bytes of a TCP connection."""
UNACKNOWLEDGED_MS = 3000
"""Age of unacknowledged bytes above which TCP reconnects [ms]; later data would be stale."""
MOST_WRITES = 1024


class TcpLink(Link):
    """A link as TCP client, which reconnects by itself."""

    def __init__(
        self, address: Address, on_frame: Callable[[Any], None], parser: Parser | None = None
    ) -> None:
        super().__init__(address, on_frame, parser)
        self._writer: asyncio.StreamWriter | None = None
        self._task: asyncio.Task[None] | None = None
        self._written = 0
        self._writes: deque[tuple[int, float]] = deque(maxlen=MOST_WRITES)
        """Unacknowledged frames: for each the number of bytes written before, and its time."""

    async def open(self) -> None:
        """Connect to the server, then stay connected."""
        with os_errors_as(
            LinkError,
            self.address,
            "Check the host and port, and that the program at the other end is running",
        ):
            reader = await self._connect()
        self._task = asyncio.get_running_loop().create_task(self._run(reader))

    async def close(self) -> None:
        """Disconnect from the server for good."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    async def _connect(self) -> asyncio.StreamReader:
        reader, self._writer = await asyncio.open_connection(
            self.address.host, self.address.port
        )
        self._written = 0
        self._writes.clear()
        connected: socket.socket = self._writer.get_extra_info("socket")
        if sys.platform == "linux":
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
        self._parser.reset()
        return reader

    async def _run(self, reader: asyncio.StreamReader) -> None:
        while True:
            try:
                while data := await reader.read(READ_SIZE):
                    self._take(data)
            except OSError as error:
                log.warning("link failed", address=str(self.address), reason=str(error))
            reader = await self._reconnect()

    async def _reconnect(self) -> asyncio.StreamReader:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
        log.warning("link lost; reconnecting", address=str(self.address))
        while True:
            await asyncio.sleep(RETRY_S)
            try:
                reader = await self._connect()
            except OSError:
                continue
            self._reconnects += 1
            return reader

    @property
    def delay_s(self) -> float:
        """Age of the oldest unacknowledged byte [s]; infinite if the send buffer is full."""
        writer = self._writer
        if writer is None:
            return 0.0
        if writer.transport.get_write_buffer_size():
            return math.inf
        acknowledged = self._written - _unacknowledged(writer.get_extra_info("socket"))
        while len(self._writes) > 1 and self._writes[1][0] <= acknowledged:
            self._writes.popleft()
        if acknowledged >= self._written or not self._writes:
            self._writes.clear()
            return 0.0
        return monotonic_s() - self._writes[0][1]

    def _write(self, frame: bytes) -> bool:
        writer = self._writer
        if writer is None or writer.is_closing():
            return False
        if writer.transport.get_write_buffer_size() > MAX_PENDING:
            return False
        self._writes.append((self._written, monotonic_s()))
        self._written += len(frame)
        writer.write(frame)
        return True


class SerialLink(Link):
    """Link by a serial port: pyserial sets it up, the loop watches its file descriptor."""

    def __init__(
        self, address: Address, on_frame: Callable[[Any], None], parser: Parser | None = None
    ) -> None:
        super().__init__(address, on_frame, parser)
        self._port: serial.Serial | None = None
        self._fd = -1
        self._pending = b""
        self._closed = False
        self._retry: asyncio.TimerHandle | None = None

    async def open(self) -> None:
        """Open the serial port exclusively."""
        try:
            self._open()
        except (OSError, ValueError) as error:
            raise _serial_error(self.address, error) from error

    async def close(self) -> None:
        """Close the serial port for good."""
        self._closed = True
        if self._retry is not None:
            self._retry.cancel()
        self._release()

    def _open(self) -> None:
        self._port = serial.Serial(
            self.address.device, self.address.baud, timeout=0, exclusive=True
        )
        self._fd = self._port.fileno()
        os.set_blocking(self._fd, False)
        self._parser.reset()
        self._pending = b""
        asyncio.get_running_loop().add_reader(self._fd, self._readable)

    def _release(self) -> None:
        if self._port is not None:
            loop = asyncio.get_running_loop()
            loop.remove_reader(self._fd)
            loop.remove_writer(self._fd)
            self._port.close()
            self._port = None

    def _readable(self) -> None:
        try:
            data = os.read(self._fd, READ_SIZE)
        except BlockingIOError:
            return
        except OSError as error:
            self._lost(str(error))
            return
        if data:
            self._take(data)
        else:
            self._lost("the device was disconnected")

    def _lost(self, reason: str) -> None:
        log.warning("link lost; reconnecting", address=str(self.address), reason=reason)
        self._release()
        self._retry_later()

    def _retry_later(self) -> None:
        self._retry = asyncio.get_running_loop().call_later(RETRY_S, self._reopen)

    def _reopen(self) -> None:
        if self._closed:
            return
        try:
            self._open()
        except (OSError, ValueError):
            self._retry_later()
        else:
            self._reconnects += 1

    @property
    def delay_s(self) -> float:
        """Time that a new frame would wait at the port's rate [s]."""
        held = len(self._pending)
        if self._port is not None:
            with suppress(OSError):
                held += self._port.out_waiting
        return held * BITS_PER_BYTE / self.address.baud

    def _write(self, frame: bytes) -> bool:
        if self._port is None or len(self._pending) + len(frame) > SERIAL_PENDING:
            return False
        waiting = bool(self._pending)
        self._pending += frame
        if not waiting:
            self._flush()
        return True

    def _flush(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            written = os.write(self._fd, self._pending)
        except BlockingIOError:
            written = 0
        except OSError as error:
            self._lost(str(error))
            return
        self._pending = self._pending[written:]
        if self._pending:
            loop.add_writer(self._fd, self._flush)
        else:
            loop.remove_writer(self._fd)


def _unacknowledged(connected: socket.socket) -> int:
    """Number of bytes that the TCP peer has not acknowledged yet; 0 if not reported."""
    if sys.platform != "linux":
        return 0
    import fcntl

    with suppress(OSError, ValueError):
        unacknowledged: int = struct.unpack("i", fcntl.ioctl(connected, SIOCOUTQ, bytes(4)))[0]
        return unacknowledged
    return 0


def _serial_error(address: Address, error: OSError | ValueError) -> LinkError:
    """Describe the fault of a serial port, and the remedy."""
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        ports = ", ".join(sorted(port.device for port in list_ports.comports())) or "none"
        message, remedy = "no such serial port", f"Check the cable; ports present: {ports}"
    elif number in (errno.EACCES, errno.EPERM):
        message = "no permission for the serial port"
        remedy = "Run `sudo usermod -aG dialout $USER`, then log in again"
    elif number in (errno.EAGAIN, errno.EBUSY) or "lock" in str(error):
        message = "the serial port is in use"
        remedy = "Stop the program that uses the port (`fuser -v` on the device shows which)"
    else:
        message, remedy = f"cannot open: {error}", "Check the device and the baud rate"
    return LinkError(f"{address}: {message}", remedy=remedy)
