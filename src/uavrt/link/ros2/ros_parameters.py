"""Serve the drone's parameters by ROS 2's parameter services.

Names, values and limits are those of the MAVLink parameters (`uavrt.config.parameters`).
Changes are sent to the supervisor as commands, and the client's reply waits for its answer.
"""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from uavrt.config.parameters import OFFERED, RUN, Parameter, parameter_values, with_parameter
from uavrt.config.settings import Settings
from uavrt.core.errors import ConfigError
from uavrt.core.messages import CommandReply
from uavrt.core.newest import Newest
from uavrt.link.ros2.types.parameter_messages import (
    DescribeReply,
    DescribeRequest,
    FloatingPointRange,
    GetReply,
    GetRequest,
    IntegerRange,
    ListParametersResult,
    ListReply,
    ListRequest,
    ParameterDescriptor,
    ParameterValue,
    RosParameter,
    ServiceMessage,
    SetParametersResult,
    SetReply,
    SetRequest,
    SetTogetherReply,
    SetTogetherRequest,
    TypesReply,
    TypesRequest,
)

BOOL, INTEGER, DOUBLE = 1, 2, 3
"""Numbers of rcl_interfaces/ParameterType; 0 is "not set"."""
PENDING = 16
"""Largest number of requests to set parameters that may wait for the supervisor's answer."""
MOST_AT_ONCE = 32
"""Largest number of parameters that one request may set."""
DONE = SetParametersResult(successful=True)

Ask = Callable[[str, float], int | None]
"""Function that sends a parameter change to the supervisor; returns its number or None."""


@dataclass(slots=True)
class _Setting:
    """A request to set parameters that is in progress, one parameter after the other."""

    request: SetRequest | SetTogetherRequest
    left: deque[RosParameter]
    results: list[SetParametersResult] = field(default_factory=list)


class ParameterServices:
    """Answers requests for parameters while detection is `running`.

    `ask`: function that sends a requested change to the supervisor.
    """

    def __init__(
        self,
        settings: Callable[[], Settings],
        running: Callable[[], bool],
        *,
        ask: Ask,
        reply: Callable[[ServiceMessage], None],
    ) -> None:
        self._settings, self._running = settings, running
        self._ask, self._reply = ask, reply
        self._pending: Newest[int, _Setting] = Newest(PENDING)

    def receive(self, request: ServiceMessage, refusal: str | None = None) -> None:
        """Handle a request; `refusal`: reason why its sender may not set parameters."""
        requester = {"guid": request.guid, "sequence": request.sequence}
        match request:
            case ListRequest():
                names = tuple(n for n in OFFERED if _below(n, request.prefixes))
                result = ListParametersResult(names=names)
                self._reply(ListReply(**requester, result=result))
            case GetRequest():
                values = tuple(map(self._value, request.names))
                self._reply(GetReply(**requester, values=values))
            case TypesRequest():
                types = tuple(self._value(name).type for name in request.names)
                self._reply(TypesReply(**requester, types=types))
            case DescribeRequest():
                found = tuple(map(_description, request.names))
                self._reply(DescribeReply(**requester, descriptors=found))
            case SetRequest() | SetTogetherRequest():
                self._begin(request, refusal)

    def answered(self, reply: CommandReply) -> None:
        """Handle the supervisor's answer to a change."""
        setting = self._pending.pop(reply.request_id, None)
        if setting is None:
            return
        reason = "" if reply.accepted else reply.message
        setting.results.append(SetParametersResult(successful=reply.accepted, reason=reason))
        self._go_on(setting)

    def _begin(self, request: SetRequest | SetTogetherRequest, refusal: str | None) -> None:
        if refusal is None and len(request.parameters) > MOST_AT_ONCE:
            refusal = f"a request may set at most {MOST_AT_ONCE} parameters"
        if refusal is None and isinstance(request, SetTogetherRequest):
            refusal = self._fault_of_all(request.parameters)
        setting = _Setting(request, deque(request.parameters))
        if refusal is not None:
            result = SetParametersResult(reason=refusal)
            setting.results = [result] * len(request.parameters) or [result]
            setting.left.clear()
        self._go_on(setting)

    def _fault_of_all(self, parameters: Iterable[RosParameter]) -> str | None:
        """Text on the first invalid value of a request; None if all are valid."""
        settings = self._settings()
        try:
            for parameter in parameters:
                value = _number(parameter)
                if parameter.name != RUN.name:
                    settings = with_parameter(settings, parameter.name, value)
        except ConfigError as error:
            return str(error)
        return None

    def _go_on(self, setting: _Setting) -> None:
        """Set the next parameter of a request; send the reply once all are set."""
        together = isinstance(setting.request, SetTogetherRequest)
        while setting.left:
            if together and any(not result.successful for result in setting.results):
                break
            wanted = setting.left.popleft()
            try:
                number = self._ask(wanted.name, _number(wanted))
            except ConfigError as error:
                setting.results.append(SetParametersResult(reason=str(error)))
                continue
            if number is not None:
                self._pending[number] = setting
                return
            setting.results.append(SetParametersResult(reason="too many commands are pending"))
        self._finish(setting)

    def _finish(self, setting: _Setting) -> None:
        request, results = setting.request, setting.results
        requester = {"guid": request.guid, "sequence": request.sequence}
        if isinstance(request, SetRequest):
            self._reply(
                SetReply(**requester, results=tuple(results[: len(request.parameters)]))
            )
            return
        bad = next((result for result in results if not result.successful), DONE)
        self._reply(SetTogetherReply(**requester, result=bad))

    def _value(self, name: str) -> ParameterValue:
        """Return the present value of a parameter; type 0 if the parameter does not exist."""
        parameter = OFFERED.get(name)
        if parameter is None:
            return ParameterValue()
        if parameter is RUN:
            return ParameterValue(type=BOOL, bool_value=self._running())
        number = parameter_values(self._settings())[name]
        kind = _type(parameter)
        if kind == BOOL:
            return ParameterValue(type=BOOL, bool_value=bool(number))
        if kind == INTEGER:
            return ParameterValue(type=INTEGER, integer_value=int(number))
        return ParameterValue(type=DOUBLE, double_value=number)


def _type(parameter: Parameter) -> int:
    return {"switch": BOOL, "real": DOUBLE}.get(parameter.kind, INTEGER)


def _below(name: str, prefixes: tuple[str, ...]) -> bool:
    """True if `prefixes` select a parameter: the list is empty or contains the whole name.

    Parameter names have no dots, so no shorter prefix can match.
    """
    return not prefixes or name in prefixes


def _number(wanted: RosParameter) -> float:
    """Return the number in a parameter value; raises `ConfigError` for an unknown parameter or
    a wrong type.

    An integer is also accepted for a real number or a switch.
    """
    parameter = OFFERED.get(wanted.name)
    if parameter is None:
        raise ConfigError(
            f"there is no parameter {wanted.name[:40]}; known parameters are "
            f"{', '.join(OFFERED)}"
        )
    value, kind = wanted.value, _type(parameter)
    if value.type == BOOL and kind == BOOL:
        return float(value.bool_value)
    if value.type == INTEGER and kind in (INTEGER, DOUBLE, BOOL):
        return float(value.integer_value)
    if value.type == DOUBLE and kind == DOUBLE:
        return value.double_value
    words = {BOOL: "true or false", INTEGER: "a whole number", DOUBLE: "a number"}
    raise ConfigError(f"{wanted.name} must be {words[kind]}")


def _description(name: str) -> ParameterDescriptor:
    parameter = OFFERED.get(name)
    if parameter is None:
        return ParameterDescriptor(name=name)
    kind = _type(parameter)
    # The value for "left out" is outside the range.
    ends = [parameter.low, parameter.high]
    ends += [] if parameter.absent is None else [parameter.absent]
    low, high = min(ends), max(ends)
    reals = FloatingPointRange(from_value=low, to_value=high)
    wholes = IntegerRange(from_value=int(low), to_value=int(high), step=1)
    choices = ", ".join(f"{n}: {choice}" for n, choice in enumerate(parameter.choices))
    return ParameterDescriptor(
        name=name,
        type=kind,
        description=f"{parameter.short}. {parameter.meaning}",
        additional_constraints=choices,
        floating_point_range=(reals,) if kind == DOUBLE else (),
        integer_range=(wholes,) if kind == INTEGER else (),
    )
