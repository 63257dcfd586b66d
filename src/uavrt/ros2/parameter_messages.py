"""Messages of ROS 2's parameter services (package rcl_interfaces), as Cyclone's RMW sends them.

There requests and replies begin with the client and the number of the request, which other RMWs
carry outside of the data (rmw_cyclonedds_cpp, ``cdds_request_header``).
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from uavrt.ros2.messages import Bool, Byte, Float64, RosMessage, String, UInt8, ros_message

Int64 = Annotated[int, "int64"]
UInt64 = Annotated[int, "uint64"]


@ros_message("rcl_interfaces/ParameterValue")
class ParameterValue(RosMessage):
    """A value of one of nine types."""

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


@ros_message("rcl_interfaces/Parameter")
class RosParameter(RosMessage):
    """A name and a value."""

    name: String = ""
    value: ParameterValue = ParameterValue()


@ros_message("rcl_interfaces/FloatingPointRange")
class FloatingPointRange(RosMessage):
    """Range of a real number."""

    from_value: Float64 = 0.0
    to_value: Float64 = 0.0
    step: Float64 = 0.0


@ros_message("rcl_interfaces/IntegerRange")
class IntegerRange(RosMessage):
    """Range of a whole number."""

    from_value: Int64 = 0
    to_value: Int64 = 0
    step: UInt64 = 0


@ros_message("rcl_interfaces/ParameterDescriptor")
class ParameterDescriptor(RosMessage):
    """Meaning and range of a parameter."""

    name: String = ""
    type: UInt8 = 0
    description: String = ""
    additional_constraints: String = ""
    read_only: Bool = False
    dynamic_typing: Bool = False
    floating_point_range: tuple[FloatingPointRange, ...] = ()
    integer_range: tuple[IntegerRange, ...] = ()


@ros_message("rcl_interfaces/ListParametersResult")
class ListParametersResult(RosMessage):
    """Names, and the prefixes before their dots."""

    names: tuple[String, ...] = ()
    prefixes: tuple[String, ...] = ()


@ros_message("rcl_interfaces/SetParametersResult")
class SetParametersResult(RosMessage):
    """Whether a parameter was set."""

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


@ros_message("rcl_interfaces/ListParameters_Request")
class ListRequest(ServiceMessage):
    """Requests all names, or those with these prefixes."""

    prefixes: tuple[String, ...] = ()
    depth: UInt64 = 0


@ros_message("rcl_interfaces/ListParameters_Response")
class ListReply(ServiceMessage):
    """The names."""

    result: ListParametersResult = ListParametersResult()


@dataclass(frozen=True, slots=True, kw_only=True)
class NamesRequest(ServiceMessage):
    """Names of parameters."""

    names: tuple[String, ...] = ()


@ros_message("rcl_interfaces/GetParameters_Request")
class GetRequest(NamesRequest):
    """Requests values."""


@ros_message("rcl_interfaces/GetParameters_Response")
class GetReply(ServiceMessage):
    """A value for each name; of type 0 for an unknown parameter."""

    values: tuple[ParameterValue, ...] = ()


@ros_message("rcl_interfaces/GetParameterTypes_Request")
class TypesRequest(NamesRequest):
    """Requests types."""


@ros_message("rcl_interfaces/GetParameterTypes_Response")
class TypesReply(ServiceMessage):
    """A type for each name."""

    types: tuple[UInt8, ...] = ()


@ros_message("rcl_interfaces/DescribeParameters_Request")
class DescribeRequest(NamesRequest):
    """Requests descriptions."""


@ros_message("rcl_interfaces/DescribeParameters_Response")
class DescribeReply(ServiceMessage):
    """A description for each name."""

    descriptors: tuple[ParameterDescriptor, ...] = ()


@ros_message("rcl_interfaces/SetParameters_Request")
class SetRequest(ServiceMessage):
    """Parameters to set, each for itself."""

    parameters: tuple[RosParameter, ...] = ()


@ros_message("rcl_interfaces/SetParameters_Response")
class SetReply(ServiceMessage):
    """A result for each."""

    results: tuple[SetParametersResult, ...] = ()


@ros_message("rcl_interfaces/SetParametersAtomically_Request")
class SetTogetherRequest(ServiceMessage):
    """Parameters to set, all or nothing."""

    parameters: tuple[RosParameter, ...] = ()


@ros_message("rcl_interfaces/SetParametersAtomically_Response")
class SetTogetherReply(ServiceMessage):
    """One result for all."""

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
