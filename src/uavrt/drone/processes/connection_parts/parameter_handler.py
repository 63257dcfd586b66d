"""MAVLink parameters of the drone, which ground stations can read and set.

Connects MAVLink parameters (`uavrt.link.mavlink.services.parameter_service`) to the table of
settings (`uavrt.config.parameters`) and the supervisor, which alone changes them. Part of the
connection process.
"""

from collections.abc import Callable
from math import isnan

from uavrt.config.parameters import OFFERED, RUN, parameter_values
from uavrt.config.settings import Settings
from uavrt.core.errors import TunnelError
from uavrt.core.log import get_logger
from uavrt.core.messages import Command, CommandReply, StatusText
from uavrt.core.newest import Newest
from uavrt.link.mavlink.dialect import (
    MavParamType,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
)
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.services.parameter_service import ParameterServer, Requests
from uavrt.link.tunnel.own_messages.seal import read_parameter

log = get_logger()

PENDING = 64


class ParameterHandler:
    """Answers parameter requests of ground stations; passes changes to the supervisor."""

    def __init__(
        self,
        settings: Settings,
        bytewise: Callable[[], bool],
        *,
        send: Callable[[ParamValue, Peer | None], None],
        ask: Callable[[Command], None],
        notify: Callable[[StatusText], None],
        running: bool = False,
    ) -> None:
        self._settings = settings
        self._running = running
        floats = settings.mavlink.parameter_encoding == "float"
        types = {
            name: MavParamType.REAL32 if floats or row.kind == "real" else MavParamType.INT32
            for name, row in OFFERED.items()
        }
        self._server = ParameterServer(
            lambda: {**parameter_values(self._settings), RUN.name: float(self._running)},
            types,
            bytewise,
        )
        self._send, self._ask, self._notify = send, ask, notify
        self._pending: Newest[int, tuple[str, Peer]] = Newest(PENDING)
        self.refused = 0

    def receive(
        self,
        message: Requests,
        peer: Peer,
        refusal: str | None,
        request_id: int,
        *,
        sealed: bool = False,
    ) -> None:
        """Handle a request to list, read or set parameters; `refusal`: why setting is
        forbidden, or None.
        """
        answer = self._server.receive(message)
        if isinstance(answer, list):
            for value in answer:
                self._send(value, peer)
        elif refusal is not None:
            self._refuse(answer.name, refusal, peer)
        else:
            self._pending[request_id] = answer.name, peer
            self._ask(
                Command(
                    name="set_parameter",
                    request_id=request_id,
                    parameter=answer.name,
                    value=answer.value,
                    source=f"mavlink {peer}",
                    sealed=sealed,
                )
            )

    def receive_sealed(
        self, inside: bytes, peer: Peer, refusal: str | None, request_id: int
    ) -> None:
        """Handle an authenticated request to list, read or set parameters."""
        try:
            name, value = read_parameter(inside)
        except TunnelError as error:
            log.warning("malformed parameter request ignored", reason=error.message)
            return
        us = {"target_system": 0, "target_component": 0}
        request: Requests = ParamSet(
            **us, param_id=name, param_value=value, param_type=MavParamType.REAL32
        )
        if not name and isnan(value):
            request = ParamRequestList(**us)
        elif not name:
            request = ParamRequestRead(**us, param_id="", param_index=max(0, int(value)))
        self.receive(request, peer, refusal, request_id, sealed=True)

    def reply(self, reply: CommandReply) -> None:
        """Answer a station's request to set a parameter.

        The answer is the present value, or the reason why the change was refused. Changed
        settings arrive before this reply, so the value is the new one.
        """
        name, peer = self._pending.pop(reply.request_id, (None, None))
        if name is None or peer is None:
            return
        if reply.accepted:
            self._send(self._server.value(name), None)
        else:
            self._refuse(name, reply.message, peer)

    def changed(self, settings: Settings) -> None:
        """Apply changed settings, and send stations the values that another station has set."""
        before, now = parameter_values(self._settings), parameter_values(settings)
        self._settings = settings
        for name, value in now.items():
            if before[name] != value and not self._is_pending(name):
                self._send(self._server.value(name), None)

    def running(self, running: bool) -> None:
        """Set whether detection runs; call it before `reply` to the start or stop command."""
        changed, self._running = self._running is not running, running
        if changed and not self._is_pending(RUN.name):
            self._send(self._server.value(RUN.name), None)

    def _is_pending(self, name: str) -> bool:
        return any(name == wanted for wanted, _ in self._pending.values())

    def _refuse(self, name: str, reason: str, peer: Peer) -> None:
        self.refused += 1
        self._send(self._server.value(name), peer)
        self._notify(StatusText(severity=4, text=reason))
