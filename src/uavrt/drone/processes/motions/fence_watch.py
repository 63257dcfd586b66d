"""Read the autopilot's geofence over its link, for the guide.

The fence is read when the autopilot is found, and every half minute while no order is flown.
"""

from collections import Counter
from collections.abc import Callable
from math import inf

from uavrt.core.errors import FormatError
from uavrt.core.log import get_logger
from uavrt.core.messages import VehicleFence
from uavrt.guidance.files.mission import fence_of
from uavrt.link.mavlink.autopilot.mission_transfer import MissionDownload
from uavrt.link.mavlink.dialect import MavComponent
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.message import Message

log = get_logger()

FENCE_PERIOD_S = 30.0


class FenceWatch:
    """Downloads the autopilot's geofence and sends it to the guide process."""

    def __init__(
        self,
        send: Callable[[Message], None],
        report: Callable[[VehicleFence], None],
        place: Callable[[], tuple[int, int]],
    ) -> None:
        self._send, self._report, self._place = send, report, place
        self._download: MissionDownload | None = None
        self._next_s = -inf
        self._known: VehicleFence | None = None
        self._counted: Counter[str] = Counter()

    def autopilot_found(self) -> None:
        """Discard the geofence, because it may belong to another autopilot."""
        self._download, self._known, self._next_s = None, None, -inf

    def vehicle(self, message: Message, now_s: float) -> None:
        """Handle a message from the autopilot, which may be part of a requested geofence."""
        download = self._download
        if download is not None:
            sender = (self._place()[0], MavComponent.COMP_ID_AUTOPILOT1)
            self._send_all(download.receive(message, sender, now_s))
            self._end(download)

    def tick(self, now_s: float, *, resting: bool) -> None:
        """Send download requests that are due.

        A download begins only while no order is flown (`resting`).
        """
        if self._download is None and resting and now_s >= self._next_s:
            own = self._place()
            peer = Peer(own[0], MavComponent.COMP_ID_AUTOPILOT1)
            self._download = MissionDownload("fence", peer, own)
        if self._download is not None:
            self._next_s = now_s + FENCE_PERIOD_S
            self._send_all(self._download.due(now_s))
            self._end(self._download)

    def repeat(self) -> None:
        """Send the known fence again, because the guide process was restarted."""
        if self._known is not None:
            self._report(self._known)

    def counters(self) -> dict[str, float]:
        """Counts of downloads and repeated requests, for the health report."""
        return {f"fence_{name}": float(count) for name, count in self._counted.items()}

    def _end(self, download: MissionDownload) -> None:
        if not download.over:
            return
        self._download = None
        self._counted += download.counters
        if download.fault is not None:
            self._counted["not_read"] += 1
            log.seldom(self._counted["not_read"], "fence not read", reason=download.fault)
            return
        self._counted["read"] += 1
        try:
            fence = fence_of(download.items)
        except FormatError as error:
            fence = VehicleFence(fault=str(error))
        if fence != self._known:
            log.info(
                "fence",
                within=len(fence.within),
                keep_out=len(fence.keep_out),
                fault=fence.fault,
            )
        self._known = fence
        self._report(fence)

    def _send_all(self, messages: list[Message]) -> None:
        for message in messages:
            self._send(message)
