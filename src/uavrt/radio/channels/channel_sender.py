"""Send channels to UDP ports in the format of the original channelizer."""

import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import ChannelBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.radio.channels.channel_datagram import SAMPLES, StampStyle, encode_channel_datagram
from uavrt.radio.udp_address import send_socket


@dataclass(slots=True)
class _Frame:
    samples: NDArray[np.complex64] = field(
        default_factory=lambda: np.zeros(SAMPLES, np.complex64)
    )
    filled: int = 0
    time_ns: int = 0


class ChannelDatagramSender:
    """Cuts channels into frames of 1024 samples and sends each frame to its channel's ports.

    Sending never blocks: if the system's buffer is full, the frame is dropped and counted.
    """

    def __init__(
        self,
        ports: Mapping[int, Sequence[int]],
        *,
        host: str = "127.0.0.1",
        style: StampStyle = "seconds",
    ) -> None:
        self._host = host
        self._style: StampStyle = style
        self._ports = {channel: tuple(numbers) for channel, numbers in ports.items()}
        self._frames = {channel: _Frame() for channel in self._ports}
        # One socket per port: a refusal is reported at the next datagram of the same socket.
        self._sockets: dict[int, socket.socket] = {}
        for numbers in self._ports.values():
            for port in numbers:
                sock = self._sockets[port] = send_socket(host)
                sock.connect((host, port))
        self.datagrams = 0
        """Number of UDP datagrams of samples sent, whether received or not."""
        self.unheard = 0
        """Number of UDP datagrams refused because no program listens at the port."""
        self.dropped = 0
        """Number of UDP datagrams dropped because the system's buffer was full."""

    def send(self, block: ChannelBlock) -> None:
        """Add the next block of a channel and send the frames that are then complete.

        If samples are missing, the rest of the frame is filled with zeros, at most as many as
        are missing. A new frame begins with the first sample after the zeros.
        """
        frame = self._frames.get(block.channel)
        if frame is None:
            return
        if block.lost_before and frame.filled:
            zeros = min(block.lost_before, SAMPLES - frame.filled)
            frame.samples[frame.filled : frame.filled + zeros] = 0.0
            frame.filled += zeros
            if frame.filled == SAMPLES:
                self._complete(block.channel, frame)
        done = 0
        while done < len(block.samples):
            if frame.filled == 0:
                frame.time_ns = block.time_ns + round(
                    done * NANOSECONDS_PER_SECOND / block.sample_rate_hz
                )
            part = block.samples[done : done + SAMPLES - frame.filled]
            frame.samples[frame.filled : frame.filled + len(part)] = part
            frame.filled += len(part)
            done += len(part)
            if frame.filled == SAMPLES:
                self._complete(block.channel, frame)

    def close(self) -> None:
        """Close the sockets; an incomplete frame is not sent, as in the original system."""
        for sock in self._sockets.values():
            sock.close()

    def _complete(self, channel: int, frame: _Frame) -> None:
        datagram = encode_channel_datagram(frame.samples, frame.time_ns, self._style)
        frame.filled = 0
        for port in self._ports[channel]:
            self._send(self._sockets[port], datagram)

    def _send(self, sock: socket.socket, datagram: bytes) -> None:
        # The error is the refusal of the previous datagram; this one was not sent.
        for attempt in range(2):
            try:
                sock.send(datagram)
            except ConnectionRefusedError:
                self.unheard += 1 - attempt
            except BlockingIOError:
                self.dropped += 1
                return
            except OSError:
                self.dropped += 1  # the network is down; later datagrams may pass
                return
            else:
                self.datagrams += 1
                return
