"""Messages of ROS 2's parameter services (rcl_interfaces), as Cyclone's RMW sends them.

On Cyclone's RMW, requests and replies begin with the client and the number of the request
(rmw_cyclonedds_cpp, ``cdds_request_header``). Other RMWs send these outside of the data.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from uavrt.link.ros2.types.ros_messages import (
    Bool,
    Byte,
    Float64,
    RosMessage,
    String,
    UInt8,
    ros_message,
)

Int64 = Annotated[int, "int64"]
UInt64 = Annotated[int, "uint64"]


@ros_message("rcl_interfaces/ParameterValue")
class ParameterValue(RosMessage):
    """Value of a parameter, of one of nine types."""

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
    """Name and value of a parameter."""

    name: String = ""
    value: ParameterValue = ParameterValue()


@ros_message("rcl_interfaces/FloatingPointRange")
class FloatingPointRange(RosMessage):
    """Range of a parameter that is a real number."""

    from_value: Float64 = 0.0
    to_value: Float64 = 0.0
    step: Float64 = 0.0


@ros_message("rcl_interfaces/IntegerRange")
class IntegerRange(RosMessage):
    """Range of a parameter that is an integer."""

    from_value: Int64 = 0
    to_value: Int64 = 0
    step: UInt64 = 0


@ros_message("rcl_interfaces/ParameterDescriptor")
class ParameterDescriptor(RosMessage):
    """Description and range of a parameter."""

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
    """Names of parameters, and the prefixes before their dots."""

    names: tuple[String, ...] = ()
    prefixes: tuple[String, ...] = ()


@ros_message("rcl_interfaces/SetParametersResult")
class SetParametersResult(RosMessage):
    """Result of setting a parameter: success, or the reason of a failure."""

    successful: Bool = False
    reason: String = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceMessage(RosMessage):
    """Base of requests and replies on Cyclone's RMW."""

    interface: ClassVar[str] = "srv"
    guid: UInt64 = 0
    """Identifier of the client that sends the request."""
    sequence: Int64 = 0
    """Number of the client's request."""


@ros_message("rcl_interfaces/ListParameters_Request")
class ListRequest(ServiceMessage):
    """Request for the names of all parameters, or those with given prefixes."""

    prefixes: tuple[String, ...] = ()
    depth: UInt64 = 0


@ros_message("rcl_interfaces/ListParameters_Response")
class ListReply(ServiceMessage):
    """Reply with the names of parameters."""

    result: ListParametersResult = ListParametersResult()


@dataclass(frozen=True, slots=True, kw_only=True)
class NamesRequest(ServiceMessage):
    """Base of requests with names of parameters."""

    names: tuple[String, ...] = ()


@ros_message("rcl_interfaces/GetParameters_Request")
class GetRequest(NamesRequest):
    """Request for the values of parameters."""


@ros_message("rcl_interfaces/GetParameters_Response")
class GetReply(ServiceMessage):
    """Reply with a value for each name; of type 0 for an unknown parameter."""

    values: tuple[ParameterValue, ...] = ()


@ros_message("rcl_interfaces/GetParameterTypes_Request")
class TypesRequest(NamesRequest):
    """Request for the types of parameters."""


@ros_message("rcl_interfaces/GetParameterTypes_Response")
class TypesReply(ServiceMessage):
    """Reply with a type for each name."""

    types: tuple[UInt8, ...] = ()


@ros_message("rcl_interfaces/DescribeParameters_Request")
class DescribeRequest(NamesRequest):
    """Request for the descriptions of parameters."""


@ros_message("rcl_interfaces/DescribeParameters_Response")
class DescribeReply(ServiceMessage):
    """Reply with a description for each name."""

    descriptors: tuple[ParameterDescriptor, ...] = ()


@ros_message("rcl_interfaces/SetParameters_Request")
class SetRequest(ServiceMessage):
    """Request to set parameters, each independently."""

    parameters: tuple[RosParameter, ...] = ()


@ros_message("rcl_interfaces/SetParameters_Response")
class SetReply(ServiceMessage):
    """Reply with a result for each parameter."""

    results: tuple[SetParametersResult, ...] = ()


@ros_message("rcl_interfaces/SetParametersAtomically_Request")
class SetTogetherRequest(ServiceMessage):
    """Request to set all parameters or none."""

    parameters: tuple[RosParameter, ...] = ()


@ros_message("rcl_interfaces/SetParametersAtomically_Response")
class SetTogetherReply(ServiceMessage):
    """Reply with one result for all parameters."""

    result: SetParametersResult = SetParametersResult()


SERVICES: dict[str, tuple[type[ServiceMessage], type[ServiceMessage]]] = {
    "list_parameters": (ListRequest, ListReply),
    "get_parameters": (GetRequest, GetReply),
    "get_parameter_types": (TypesRequest, TypesReply),
    "describe_parameters": (DescribeRequest, DescribeReply),
    "set_parameters": (SetRequest, SetReply),
    "set_parameters_atomically": (SetTogetherRequest, SetTogetherReply),
}
"""Request and reply types of each parameter service."""
