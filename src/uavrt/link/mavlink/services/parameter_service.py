"""List, read and set uavrt's parameters from ground stations (MAVLink protocol); no I/O.

A value travels in a field of type float. An integer is either cast to float (ArduPilot) or its
bytes are put there (PX4). The capability bits declare which; ground stations assume it by the
vehicle's autopilot.
"""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.dialect import MavParamType

Requests = dialect.ParamRequestList | dialect.ParamRequestRead | dialect.ParamSet

_FORMATS: dict[int, str] = {
    MavParamType.UINT8: "<B3x",
    MavParamType.INT8: "<b3x",
    MavParamType.UINT16: "<H2x",
    MavParamType.INT16: "<h2x",
    MavParamType.UINT32: "<I",
    MavParamType.INT32: "<i",
}


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """A requested change of a parameter."""

    name: str
    value: float


class ParameterServer:
    """Answers MAVLink requests for uavrt's parameters with the values in force."""

    def __init__(
        self,
        values: Callable[[], Mapping[str, float]],
        types: Mapping[str, MavParamType],
        bytewise: Callable[[], bool],
    ) -> None:
        self._values = values
        self._types = dict(types)
        self._names = list(types)
        self._bytewise = bytewise

    def receive(self, message: Requests) -> list[dialect.ParamValue] | ParameterChange:
        """Handle a request; return the answers, or the requested change.

        A request for an unknown name or index is not answered, because it may mean a parameter
        of the autopilot.
        """
        match message:
            case dialect.ParamRequestList():
                return [self.value(name) for name in self._names]
            case dialect.ParamRequestRead(param_index=index) if index >= 0:
                return [self.value(name) for name in self._names[index : index + 1]]
            case dialect.ParamRequestRead(param_id=name):
                return [self.value(name)] if name in self._types else []
            case dialect.ParamSet(param_id=name) if name in self._types:
                value = decode_value(message.param_value, message.param_type, self._bytewise())
                return [self.value(name)] if value is None else ParameterChange(name, value)
            case _:
                return []

    def value(self, name: str) -> dialect.ParamValue:
        """Make the PARAM_VALUE message with the present value of a parameter."""
        kind = self._types[name]
        return dialect.ParamValue(
            param_id=name,
            param_value=encode_value(self._values()[name], kind, self._bytewise()),
            param_type=kind,
            param_count=len(self._names),
            param_index=self._names.index(name),
        )


def encode_value(value: float, kind: int, bytewise: bool) -> float:
    """Encode a value for the float field of a parameter message.

    An integer below -2**22 or from 0x7F800001 would be a signalling NaN there, which Python
    does not preserve; no parameter of uavrt needs such values.
    """
    layout = _FORMATS.get(kind)
    if layout is None or not bytewise:
        return value
    field: float = struct.unpack("<f", struct.pack(layout, int(value)))[0]
    return field


def decode_value(field: float, kind: int, bytewise: bool) -> float | None:
    """Decode a value of the float field; None for a 64-bit type, infinity or NaN."""
    if kind == MavParamType.REAL32 or not bytewise:
        return field if math.isfinite(field) else None
    layout = _FORMATS.get(kind)
    if layout is None:
        return None
    return float(struct.unpack(layout, struct.pack("<f", field))[0])
