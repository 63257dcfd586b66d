"""Message rates through a real autopilot, SITL or the simulated one, over two links.

The test is component 191 on one link and a ground station on the other. Each loss has one of
three causes: our own socket refused the frame, the frame was damaged, or the autopilot lost it
(if the links are good).
"""

import asyncio
import time
from dataclasses import dataclass

from uavrt.core.errors import LinkError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import Frame, FrameWriter
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import open_link
from uavrt.link.mavlink.sending.pacing import PacedQueue, Priority
from uavrt_experiments.result import Row

PAYLOAD_TYPE = 60_010
GROUND = (255, 190)
QUIET_S = 1.0
OUR_GAP_MS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkRow:
    """Result of one series of messages."""

    sent: int
    gap_ms: int
    """Time between two messages [ms]; with `ours`, the gap that our own sender keeps."""
    received: int
    not_taken: int
    """Number of messages refused by our own socket or port."""
    damaged: int
    between: int
    """Number of messages lost between the links by the autopilot."""
    ours: bool = False
    """True: queued at once as in a flight, and sent at the rate of `PacedQueue`."""

    @property
    def result(self) -> Row:
        """Table row of the received messages; our own sender may lose none."""
        return Row.counted(
            "capacity",
            "received through the link",
            f"{'our sender, ' if self.ours else ''}{self.sent} packets, {self.gap_ms} ms apart",
            self.received,
            self.sent,
            least=self.sent if self.ours else None,
            note=f"not taken {self.not_taken}, damaged {self.damaged}, "
            f"lost by the autopilot {self.between}",
        )


async def run_links(
    companion: str, ground: str, counts: tuple[int, ...], gaps_ms: tuple[int, ...]
) -> list[LinkRow]:
    """Send every series; raises `LinkError` if a link cannot be opened or has no peer."""
    got: set[int] = set()
    autopilot = asyncio.Event()

    def hear(frame: Frame) -> None:
        if frame.component_id == 1 and frame.message_id == dialect.Heartbeat.ID:
            systems.append(frame.system_id)
            autopilot.set()

    def take(frame: Frame) -> None:
        message = frame.message()
        if isinstance(message, dialect.Tunnel) and message.payload_type == PAYLOAD_TYPE:
            got.add(int.from_bytes(message.payload[:4], "little"))

    systems: list[int] = []
    up, down = await open_link(companion, hear), await open_link(ground, take)
    beat: asyncio.Task[None] | None = None
    try:
        async with asyncio.timeout(20.0):
            await autopilot.wait()
        writer = FrameWriter(systems[0], 191)
        beat = asyncio.create_task(_beat(up, writer, down))
        await asyncio.sleep(2.5)
        rows = []
        for count in counts:
            for gap_ms in gaps_ms:
                got.clear()
                rows.append(await _series(up, down, writer, got, count, gap_ms))
        for count in counts:
            got.clear()
            paced = PacedQueue()
            rows.append(await _series(up, down, writer, got, count, OUR_GAP_MS, paced))
        return rows
    except TimeoutError:
        raise LinkError(
            f"{companion}: no autopilot answered within 20 s", remedy="Check the address"
        ) from None
    finally:
        if beat is not None:
            beat.cancel()
        await up.close()
        await down.close()


async def _series(
    up: Link,
    down: Link,
    writer: FrameWriter,
    got: set[int],
    count: int,
    gap_ms: int,
    paced: PacedQueue | None = None,
) -> LinkRow:
    loop = asyncio.get_running_loop()
    refused, damaged = up.counters.dropped, down.counters.bad_crc
    start_s = loop.time()
    for number in range(count):
        payload = number.to_bytes(4, "little") + bytes(range(1, 125))
        message = dialect.Tunnel(
            target_system=GROUND[0],
            target_component=GROUND[1],
            payload_type=PAYLOAD_TYPE,
            payload_length=len(payload),
            payload=payload,
        )
        if paced is not None:
            paced.put(message, Priority.STATUS)
            while (wait_ns := paced.wait_ns(time.monotonic_ns())) != 0:  # noqa: ASYNC110
                await asyncio.sleep((wait_ns or 0) / NANOSECONDS_PER_SECOND)
            paced.take(time.monotonic_ns())
        up.send(writer.encode(message))
        wait_s = start_s + (number + 1) * gap_ms / 1e3 - loop.time()
        if paced is None and wait_s > 0.0:
            await asyncio.sleep(wait_s)
    await asyncio.sleep(QUIET_S)
    not_taken = up.counters.dropped - refused
    bad = down.counters.bad_crc - damaged
    return LinkRow(
        sent=count,
        gap_ms=gap_ms,
        received=len(got),
        not_taken=not_taken,
        damaged=bad,
        between=count - len(got) - not_taken - bad,
        ours=paced is not None,
    )


async def _beat(up: Link, writer: FrameWriter, down: Link) -> None:
    """Send heartbeats on both links, so that the autopilot learns the routes."""
    ground = FrameWriter(*GROUND)
    while True:
        up.send(writer.encode(_heartbeat(dialect.MavType.ONBOARD_CONTROLLER)))
        down.send(ground.encode(_heartbeat(dialect.MavType.GCS)))
        await asyncio.sleep(1.0)


def _heartbeat(kind: int) -> dialect.Heartbeat:
    return dialect.Heartbeat(
        type=kind,
        autopilot=dialect.MavAutopilot.INVALID,
        system_status=dialect.MavState.ACTIVE,
        mavlink_version=3,
    )
