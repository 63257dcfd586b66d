"""Messages of ROS 2's parameter services (package rcl_interfaces), as Cyclone's RMW sends them.

There requests and replies begin with the client and the number of the request, which other RMWs
carry outside of the data (rmw_cyclonedds_cpp, ``cdds_request_header``).
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from uavrt.ros2.messages import Bool, Byte, Float64, RosMessage, String, UInt8

Int64 = Annotated[int, "int64"]
UInt64 = Annotated[int, "uint64"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterValue(RosMessage):
    """A value of one of nine types."""

    ros_name: ClassVar[str] = "rcl_interfaces/ParameterValue"
    type: UInt8 = 0
    bool_value: Bool = False
    integer_value: Int64 = 0
    double_value: Float64 = 0.0
    string_value: String = ""
    byte_array_value: tuple[Byte, ...] = ()
    bool_array_value: tuple[Bool, ...] = ()
    integer_array_value: tuple[Int64, ...] = ()
    double_array_value: tuple[Float64, ...] = ()
    string_array_value: tuple[String, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RosParameter(RosMessage):
    """A name and a value."""

    ros_name: ClassVar[str] = "rcl_interfaces/Parameter"
    name: String = ""
    value: ParameterValue = ParameterValue()


@dataclass(frozen=True, slots=True, kw_only=True)
class FloatingPointRange(RosMessage):
    """Range of a real number."""

    ros_name: ClassVar[str] = "rcl_interfaces/FloatingPointRange"
    from_value: Float64 = 0.0
    to_value: Float64 = 0.0
    step: Float64 = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegerRange(RosMessage):
    """Range of a whole number."""

    ros_name: ClassVar[str] = "rcl_interfaces/IntegerRange"
    from_value: Int64 = 0
    to_value: Int64 = 0
    step: UInt64 = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDescriptor(RosMessage):
    """Meaning and range of a parameter."""

    ros_name: ClassVar[str] = "rcl_interfaces/ParameterDescriptor"
    name: String = ""
    type: UInt8 = 0
    description: String = ""
    additional_constraints: String = ""
    read_only: Bool = False
    dynamic_typing: Bool = False
    floating_point_range: tuple[FloatingPointRange, ...] = ()
    integer_range: tuple[IntegerRange, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ListParametersResult(RosMessage):
    """Names, and the prefixes before their dots."""

    ros_name: ClassVar[str] = "rcl_interfaces/ListParametersResult"
    names: tuple[String, ...] = ()
    prefixes: tuple[String, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetParametersResult(RosMessage):
    """Whether a parameter was set."""

    ros_name: ClassVar[str] = "rcl_interfaces/SetParametersResult"
    successful: Bool = False
    reason: String = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceMessage(RosMessage):
    """Beginning of requests and replies on Cyclone's RMW."""

    interface: ClassVar[str] = "srv"
    guid: UInt64 = 0
    """The client."""
    sequence: Int64 = 0
    """Number of its request."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ListRequest(ServiceMessage):
    """Requests all names, or those with these prefixes."""

    ros_name: ClassVar[str] = "rcl_interfaces/ListParameters_Request"
    prefixes: tuple[String, ...] = ()
    depth: UInt64 = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ListReply(ServiceMessage):
    """The names."""

    ros_name: ClassVar[str] = "rcl_interfaces/ListParameters_Response"
    result: ListParametersResult = ListParametersResult()


@dataclass(frozen=True, slots=True, kw_only=True)
class NamesRequest(ServiceMessage):
    """Names of parameters."""

    names: tuple[String, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class GetRequest(NamesRequest):
    """Requests values."""

    ros_name: ClassVar[str] = "rcl_interfaces/GetParameters_Request"


@dataclass(frozen=True, slots=True, kw_only=True)
class GetReply(ServiceMessage):
    """A value for each name; of type 0 for an unknown parameter."""

    ros_name: ClassVar[str] = "rcl_interfaces/GetParameters_Response"
    values: tuple[ParameterValue, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TypesRequest(NamesRequest):
    """Requests types."""

    ros_name: ClassVar[str] = "rcl_interfaces/GetParameterTypes_Request"


@dataclass(frozen=True, slots=True, kw_only=True)
class TypesReply(ServiceMessage):
    """A type for each name."""

    ros_name: ClassVar[str] = "rcl_interfaces/GetParameterTypes_Response"
    types: tuple[UInt8, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribeRequest(NamesRequest):
    """Requests descriptions."""

    ros_name: ClassVar[str] = "rcl_interfaces/DescribeParameters_Request"


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribeReply(ServiceMessage):
    """A description for each name."""

    ros_name: ClassVar[str] = "rcl_interfaces/DescribeParameters_Response"
    descriptors: tuple[ParameterDescriptor, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetRequest(ServiceMessage):
    """Parameters to set, each for itself."""

    ros_name: ClassVar[str] = "rcl_interfaces/SetParameters_Request"
    parameters: tuple[RosParameter, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetReply(ServiceMessage):
    """A result for each."""

    ros_name: ClassVar[str] = "rcl_interfaces/SetParameters_Response"
    results: tuple[SetParametersResult, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTogetherRequest(ServiceMessage):
    """Parameters to set, all or nothing."""

    ros_name: ClassVar[str] = "rcl_interfaces/SetParametersAtomically_Request"
    parameters: tuple[RosParameter, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTogetherReply(ServiceMessage):
    """One result for all."""

    ros_name: ClassVar[str] = "rcl_interfaces/SetParametersAtomically_Response"
    result: SetParametersResult = SetParametersResult()


SERVICES: dict[str, tuple[type[ServiceMessage], type[ServiceMessage]]] = {
    "list_parameters": (ListRequest, ListReply),
    "get_parameters": (GetRequest, GetReply),
    "get_parameter_types": (TypesRequest, TypesReply),
    "describe_parameters": (DescribeRequest, DescribeReply),
    "set_parameters": (SetRequest, SetReply),
    "set_parameters_atomically": (SetTogetherRequest, SetTogetherReply),
}
"""Request and reply of each service."""
