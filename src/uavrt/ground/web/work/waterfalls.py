"""Waterfall of a channel, from samples in a flight directory or live from a UDP port.

The radio link is too slow for samples, so they are a recording in a flight's ``iq/``, or
channels that the drone sends as datagrams (``[udp_channels]``) over a fast link or the
loopback.
"""

import asyncio
import base64
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.waterfall import MaximumHold, Waterfall
from uavrt.core.errors import FormatError, NotFound, UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import ChannelBlock, IQBlock, Tag
from uavrt.core.units import ns_from_s
from uavrt.dsp.frontend import FrontEnd
from uavrt.flight.flight_layout import FlightLayout
from uavrt.radio.channels.channel_datagram import (
    StampStyle,
    decode_channel_datagram,
    stamp_style,
)
from uavrt.radio.channels.channel_source import FrameOrder
from uavrt.radio.files.recording_source import RecordingSource
from uavrt.radio.opening import open_recording
from uavrt.radio.udp_address import listen, parse_udp_address

log = get_logger()

HALF_WIDTH_HZ = 800.0
"""Half-width of the picture around the tag's frequency [Hz]; the search covers ± 500 Hz."""
LONGEST_S = 120.0
"""Longest section of a recording in one picture [s]; at 3 MS/s it takes 4 s of a core."""
LOWEST_DB, SPAN_DB = -3.0, 33.0
"""Level of pixel value 0 and range of all 255 values [dB over the picture's median]."""
LIVE_RATE_HZ = 3750.0
LIVE_PULSE_S = 0.02
LIVE_COLUMNS = 8
"""Number of 10 ms frames in one column of a live waterfall, which shows their maximum; 12.5
columns a second."""
NOISE_COLUMNS = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A section of a waterfall as image data for the page."""

    start_time_ns: int
    column_s: float
    low_hz: float
    high_hz: float
    """Upper edge relative to the tag's frequency or, live, to the channel's centre [Hz]."""
    columns: int
    rows: int
    values: str
    """Pixels as base64, one byte each: column after column, from low to high frequency."""


def recordings(flight: Path) -> list[Path]:
    """List the sample recordings of a flight, sorted by name."""
    return sorted(FlightLayout(flight).iq_directory.glob("*.sigmf-meta"))


def recorded_picture(path: Path, tag: Tag, start_s: float, length_s: float) -> Picture:
    """Draw a section of a SigMF recording, at most `LONGEST_S`, around a tag's frequency."""
    source = open_recording(path)
    try:
        front = FrontEnd(
            sample_rate_hz=source.sample_rate_hz,
            center_frequency_hz=source.center_frequency_hz,
            frequencies_hz=[tag.frequency_hz],
        )
        waterfall: Waterfall | None = None
        begin_ns = source.start_time_ns + ns_from_s(start_s)
        end_ns = begin_ns + ns_from_s(min(length_s, LONGEST_S))
        for block in _blocks(source):
            if block.time_ns >= end_ns:
                break
            if _end_ns(block) < begin_ns:
                continue
            for part in front.process(block):
                waterfall = waterfall or Waterfall(
                    offset_hz=tag.frequency_hz - part.center_frequency_hz,
                    half_width_hz=HALF_WIDTH_HZ,
                    sample_rate_hz=part.sample_rate_hz,
                    pulse_width_s=tag.pulse_width_s,
                )
                waterfall.add(part)
    finally:
        source.close()
    if waterfall is None or not waterfall.power.any():
        raise FormatError(f"{path.name} has no samples in the requested time")
    power = waterfall.power
    return picture(
        power,
        noise=_noise(power),
        start_time_ns=waterfall.start_time_ns,
        column_s=waterfall.column_s,
        frequencies_hz=waterfall.frequencies_hz,
    )


def picture(
    power: NDArray[np.float32],
    *,
    noise: float,
    start_time_ns: int,
    column_s: float,
    frequencies_hz: NDArray[np.float64],
) -> Picture:
    """Scale powers (columns, rows) to bytes, in dB over the noise; no power becomes 0."""
    with np.errstate(divide="ignore"):
        level_db = 10.0 * np.log10(power / noise)
    cells = np.clip(255.0 * (level_db - LOWEST_DB) / SPAN_DB, 0.0, 255.0).astype(np.uint8)
    return Picture(
        start_time_ns=start_time_ns,
        column_s=column_s,
        low_hz=float(frequencies_hz[0]),
        high_hz=float(frequencies_hz[-1]),
        columns=power.shape[0],
        rows=power.shape[1],
        values=base64.b64encode(cells.tobytes()).decode(),
    )


class LiveWaterfall:
    """Waterfall of the channel at a UDP port; `show` gets each `Picture` as a dictionary."""

    def __init__(self, show: Callable[[dict[str, Any]], None]) -> None:
        self._show = show
        self._transports: list[asyncio.DatagramTransport] = []
        self.address: str | None = None

    async def listen(self, address: str) -> None:
        """Receive datagrams at an address; an empty address ends it. Raises `UavrtError`."""
        self.close()
        if not address:
            return
        stream = ChannelStream(self._show)
        loop = asyncio.get_running_loop()
        for sock in listen(*parse_udp_address(address)):
            transport, _ = await loop.create_datagram_endpoint(
                lambda: _Datagrams(stream), sock=sock
            )
            self._transports.append(transport)
        self.address = address

    def close(self) -> None:
        """Close the receiver of the channel's datagrams."""
        for transport in self._transports:
            transport.close()
        self._transports, self.address = [], None


class ChannelStream:
    """Converts datagrams of a channel to columns of a picture, passed to `show`."""

    def __init__(self, show: Callable[[dict[str, Any]], None]) -> None:
        self._show = show
        self._style: StampStyle | None = None
        self._frames = FrameOrder(LIVE_RATE_HZ)
        self._index = 0
        self._noise: list[NDArray[np.float32]] = []
        self.refused = 0
        """Number of received datagrams that do not hold a channel's samples."""

    def receive(self, payload: bytes) -> None:
        """Add the samples of a datagram to the picture."""
        try:
            time_ns, samples = decode_channel_datagram(payload, self._style)
            self._style = self._style or stamp_style(payload)
        except FormatError as error:
            if self.refused == 0:
                log.warning("an invalid datagram of the channel was ignored", reason=str(error))
            self.refused += 1
            return
        self._frames.put(time_ns, np.where(np.isfinite(samples), samples, 0.0))
        while (frame := self._frames.take(wait=True)) is not None:
            self._draw(*frame)

    def _draw(self, time_ns: int, samples: NDArray[np.complex64], lost: int) -> None:
        """Draw one block of 0.27 s; pulses at its edges appear in two blocks."""
        self._index += lost
        waterfall = Waterfall(
            offset_hz=0.0,
            half_width_hz=LIVE_RATE_HZ / 2,
            sample_rate_hz=LIVE_RATE_HZ,
            pulse_width_s=LIVE_PULSE_S,
        )
        waterfall.add(
            ChannelBlock(
                channel=0,
                center_frequency_hz=0.0,
                samples=samples.astype(np.complex64),
                sample_index=self._index,
                time_ns=time_ns,
                sample_rate_hz=LIVE_RATE_HZ,
            )
        )
        self._index += samples.size
        power = waterfall.power
        if power.shape[0] == 0:
            return
        held = MaximumHold(power.shape[1], 2 * -(-power.shape[0] // (2 * LIVE_COLUMNS)))
        held.put(0, power)
        self._noise = [*self._noise[-NOISE_COLUMNS:], held.values.copy()]
        made = picture(
            held.values,
            noise=_noise(np.concatenate(self._noise)),
            start_time_ns=time_ns,
            column_s=samples.size / LIVE_RATE_HZ / held.values.shape[0],
            frequencies_hz=waterfall.frequencies_hz,
        )
        self._show(asdict(made))


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self, stream: ChannelStream) -> None:
        self._stream = stream

    def datagram_received(self, data: bytes, addr: Any) -> None:
        """Pass a received datagram to the stream."""
        try:
            self._stream.receive(data)
        except (UavrtError, ValueError) as error:
            log.warning(
                "a datagram of the channel is not shown in the waterfall", reason=str(error)
            )


def tag_of(tags: tuple[Tag, ...], tag_id: int) -> Tag:
    """Find a tag by its id; raises `UsageError`."""
    for tag in tags:
        if tag.tag_id == tag_id:
            return tag
    raise NotFound(f"there is no tag {tag_id} in this flight")


def _blocks(source: RecordingSource) -> Iterator[IQBlock]:
    while True:
        try:
            block = source.read()
        except EOFError:
            return
        if block is not None:
            yield block


def _noise(power: NDArray[np.float32]) -> float:
    """Median of a spectrogram's powers above zero; 1 if all powers are zero."""
    return float(np.median(power[power > 0.0])) if power.any() else 1.0


def _end_ns(block: IQBlock) -> int:
    return block.time_ns + ns_from_s(block.samples.size / block.sample_rate_hz)
