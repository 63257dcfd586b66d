"""Type, identity, battery and wind that the autopilot reports in its messages."""

from collections.abc import Callable
from math import inf

from uavrt.guidance.autopilot_behaviour import AutopilotName
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.vehicle_messages import kind_of, wind_of
from uavrt.link.mavlink.discovery import Peer, request_message
from uavrt.link.mavlink.links.address import Address
from uavrt.link.mavlink.message import Message

IDENTITY_S = 3.0
BATTERY_AGE_S, WIND_AGE_S = 10.0, 30.0
TCP_IS_LATE = (
    "not flown over TCP: commands could arrive seconds late. "
    "Set mavlink.address to a serial port or UDP"
)
SIMULATOR_NUMBER = 0x75617672
"""Hardware id (``uavr``) that `uavrt.simulation.vehicle.fake_autopilot` reports."""


class ReportedAutopilot:
    """Latest values reported by the autopilot. `link` is the address of its link."""

    def __init__(self, link: Address | None) -> None:
        self._on_loopback = link is not None and link.is_loopback
        late = link is not None and link.kind == "tcp" and not link.is_loopback
        self.link_fault = TCP_IS_LATE if late else None
        """Reason why no order can be flown over this link; None if orders can be flown."""
        self.reset()

    def reset(self) -> None:
        """Delete all values, because another autopilot may have connected."""
        self.kind: AutopilotName | None = None
        self._simulated: bool | None = None
        self._identity_asked_s = -inf
        self._battery_percent: float | None = None
        self._wind_m_s: tuple[float, float] | None = None
        self._battery_s = self._wind_s = -inf

    def receive(self, message: Message, arrived_s: float) -> None:
        """Store the type, identity, battery charge or wind of an autopilot's message."""
        match message:
            case dialect.Heartbeat():
                self.kind = kind_of(message)
            case dialect.AutopilotVersion() if self._simulated is not False:
                self._simulated = message.uid == SIMULATOR_NUMBER
            case dialect.SysStatus():
                left = message.battery_remaining
                self._battery_percent = float(left) if 0 <= left <= 100 else None
                self._battery_s = arrived_s
            case dialect.Wind() | dialect.WindCov():
                self._wind_m_s, self._wind_s = wind_of(message), arrived_s

    @property
    def takes_unsealed(self) -> bool:
        """True if orders need no authentication: a simulator runs on this computer."""
        return bool(self._simulated) and self._on_loopback

    def ask_identity(
        self, send: Callable[[Message], None], system_id: int, now_s: float
    ) -> None:
        """Request the autopilot's identity at intervals, until a real autopilot answers."""
        asks = self.kind is not None and self._simulated is not False
        if asks and now_s - self._identity_asked_s > IDENTITY_S:
            self._identity_asked_s = now_s
            send(request_message(Peer(system_id, 1), dialect.AutopilotVersion.ID))

    def battery_percent(self, now_s: float) -> float | None:
        """Charge of the battery [%]; None if not reported for `BATTERY_AGE_S`."""
        return self._battery_percent if now_s - self._battery_s <= BATTERY_AGE_S else None

    def wind_m_s(self, now_s: float) -> tuple[float, float] | None:
        """Wind velocity to east and north [m/s]; None if older than `WIND_AGE_S`."""
        return self._wind_m_s if now_s - self._wind_s <= WIND_AGE_S else None
