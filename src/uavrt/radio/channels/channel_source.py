"""Receive one channel as datagrams, from the original channelizer or from uavrt.

Frames are sorted by their time stamps. The receiver waits briefly for a missing frame, then
reports a gap. A frame that arrives after that is dropped.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import FormatError
from uavrt.core.log import get_logger
from uavrt.core.messages import IQBlock
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.radio.channels.channel_datagram import (
    StampStyle,
    decode_channel_datagram,
    stamp_style,
)
from uavrt.radio.live_source import DatagramSource

TOLERANCE_S: Final = 0.005
"""Maximum difference between a frame's time stamp and the expected time, for the frame to count
as the next one [s]. The stamps of the thesis's channelizer are truncated to 1 ms; those of the
newer channelizer step by 5.4 ms when its count restarts."""
HELD_FRAMES: Final = 4
"""Number of later frames stored while a missing one may still arrive: 1.1 s of samples."""
SILENCE_S: Final = 1.5
"""Time without datagrams after which stored frames are released despite gaps [s]."""
RESTART_FRAMES: Final = 3
"""Number of consecutive frames with time stamps earlier than expected that shows that the
sender's clock was set back."""
_LARGEST: Final = 65_536
LONGEST_GAP_S: Final = 3600.0
"""Longest forward jump of the time stamps that counts as lost samples [s]; a longer jump means
that the sender's clock was changed."""

log = get_logger()


class ChannelDatagramSource(DatagramSource):
    """Receives the samples of one channel at a UDP port; a `SampleSource`.

    `address`: for example ``udp://127.0.0.1:20000``. `sample_rate_hz`: sample rate of the
    channel; 3750 with the original channelizer. Raises `RadioError` if the port is in use,
    `ConfigError` or `FormatError` for an invalid address or rate.
    """

    def __init__(
        self,
        address: str,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
    ) -> None:
        super().__init__(sample_rate_hz, center_frequency_hz)
        self.late = 0
        """Number of UDP datagrams dropped because they were late or repeated."""
        self.refused = 0
        """Number of UDP datagrams refused because they are not valid sample frames."""
        self._style: StampStyle | None = None
        self._frames = FrameOrder(sample_rate_hz)
        self._arrived_s = monotonic_s()
        self._listen(address)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next frame in order of time; None if none is ready within `timeout_s`."""
        deadline_s = None if timeout_s is None else monotonic_s() + timeout_s
        while True:
            self._receive()
            silent = monotonic_s() - self._arrived_s > SILENCE_S
            frame = self._frames.take(wait=not silent)
            self.late = self._frames.late
            if frame is not None:
                return self._block(*frame)
            left_s = None if deadline_s is None else deadline_s - monotonic_s()
            if left_s is not None and left_s <= 0.0:
                return None
            self._poll.poll(1000.0 * (SILENCE_S if left_s is None else min(left_s, SILENCE_S)))

    def _receive(self) -> None:
        for sock in self._sockets:
            while self._frames.waiting <= HELD_FRAMES:
                try:
                    payload = sock.recv(_LARGEST)
                except BlockingIOError:
                    break
                self._arrived_s = monotonic_s()
                self._accept(payload)

    def _accept(self, payload: bytes) -> None:
        try:
            time_ns, samples = decode_channel_datagram(payload, self._style)
        except FormatError as error:
            if self.refused == 0:
                log.warning("invalid datagram ignored", port=self.name, reason=str(error))
            self.refused += 1
            return
        self._style = stamp_style(payload) if self._style is None else self._style
        bad = ~np.isfinite(samples)
        if bad.any():
            samples[bad] = 0.0
        self._frames.put(time_ns, samples)

    def _block(self, time_ns: int, samples: NDArray[np.complex64], lost: int) -> IQBlock:
        placer = self._placer
        placer.lost += lost
        placer.index += lost
        block = IQBlock(
            samples=samples,
            sample_index=placer.index,
            time_ns=time_ns,
            sample_rate_hz=self.sample_rate_hz,
            lost_before=lost,
        )
        placer.index += len(samples)
        return block


class FrameOrder:
    """Sorts the frames of a channel by time and finds missing frames."""

    def __init__(self, sample_rate_hz: float) -> None:
        self._rate_hz = sample_rate_hz
        self._tolerance_ns = ns_from_s(TOLERANCE_S)
        self._held: list[tuple[int, NDArray[np.complex64]]] = []
        self._early: list[tuple[int, NDArray[np.complex64]]] = []
        self._expected_ns: int | None = None
        self.late = 0
        """Number of sample frames dropped because they were late or repeated."""

    @property
    def waiting(self) -> int:
        """Number of frames that were added but not yet taken."""
        return len(self._held)

    def put(self, time_ns: int, samples: NDArray[np.complex64]) -> None:
        """Add a frame; frames may arrive in any order."""
        if self._expected_ns is not None and time_ns < self._expected_ns - self._tolerance_ns:
            self._put_early(time_ns, samples)
            return
        self._early.clear()
        if any(abs(time_ns - held) <= self._tolerance_ns for held, _ in self._held):
            self.late += 1
            return
        self._held.append((time_ns, samples))
        self._held.sort(key=lambda frame: frame[0])

    def take(self, *, wait: bool = True) -> tuple[int, NDArray[np.complex64], int] | None:
        """Get the next frame: time [ns], samples, and the number of samples lost before it.

        Returns None if there is no frame. With `wait`, it also returns None while an earlier
        frame is missing and may still arrive.
        """
        if not self._held:
            return None
        time_ns, samples = self._held[0]
        ahead_ns = 0 if self._expected_ns is None else time_ns - self._expected_ns
        if wait and ahead_ns > self._tolerance_ns and len(self._held) <= HELD_FRAMES:
            return None
        del self._held[0]
        self._expected_ns = time_ns + self._duration_ns(len(samples))
        is_gap = self._tolerance_ns < ahead_ns < LONGEST_GAP_S * NANOSECONDS_PER_SECOND
        lost = round(ahead_ns * self._rate_hz / NANOSECONDS_PER_SECOND) if is_gap else 0
        return time_ns, samples, lost

    def _put_early(self, time_ns: int, samples: NDArray[np.complex64]) -> None:
        """Store a frame that is older than expected; several show that the sender restarted."""
        self.late += 1
        if self._early:
            last_ns, last = self._early[-1]
            follows_ns = last_ns + self._duration_ns(len(last))
            if abs(time_ns - follows_ns) > self._tolerance_ns:
                self._early.clear()
        self._early.append((time_ns, samples))
        if len(self._early) == RESTART_FRAMES:
            self._held = [*self._early]
            self._early.clear()
            self.late -= RESTART_FRAMES
            self._expected_ns = None

    def _duration_ns(self, samples: int) -> int:
        return round(samples * NANOSECONDS_PER_SECOND / self._rate_hz)
