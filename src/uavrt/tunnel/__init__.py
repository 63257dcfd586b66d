"""The tunnel's wire formats: one file per generation of the protocol (`g0`, `g1`, `g2`).

`decode` reads a payload, ``message.encode()`` writes one, `uavrt.tunnel.convert` goes between
these messages and the records of `uavrt.messages`. Pure: no sockets, no clock.
"""

from uavrt.tunnel.codec import TunnelMessage, acked_command_of, decode, generation_of
from uavrt.tunnel.convert import (
    ack_to_wire,
    detector_heartbeat,
    heartbeat_to_wire,
    pulse_from_wire,
    pulse_to_wire,
    search_report_to_wire,
    tag_from_wire,
    tag_of_number,
    tag_to_wire,
)
from uavrt.tunnel.g0 import FAILURE, SUCCESS, AckG0, HeaderMessage, PulseG0, TagG0
from uavrt.tunnel.g1 import AckG1, Heartbeat, PulseG1, RawCapture, StartDetection, TagG1
from uavrt.tunnel.g2 import (
    AckG2,
    BareG2,
    DetectorHeartbeat,
    HeartbeatG2,
    HeartbeatG2v1,
    OperationProgress,
    PulseG2,
    PulseG2v1,
    RawCaptureG2,
    StartDetectionG2,
    TagG2,
    UploadG2,
)
from uavrt.tunnel.wire import (
    MAX_PAYLOAD,
    PAYLOAD_TYPE,
    CommandId,
    Generation,
    command_name,
)

__all__ = [
    "FAILURE",
    "MAX_PAYLOAD",
    "PAYLOAD_TYPE",
    "SUCCESS",
    "AckG0",
    "AckG1",
    "AckG2",
    "BareG2",
    "CommandId",
    "DetectorHeartbeat",
    "Generation",
    "HeaderMessage",
    "Heartbeat",
    "HeartbeatG2",
    "HeartbeatG2v1",
    "OperationProgress",
    "PulseG0",
    "PulseG1",
    "PulseG2",
    "PulseG2v1",
    "RawCapture",
    "RawCaptureG2",
    "StartDetection",
    "StartDetectionG2",
    "TagG0",
    "TagG1",
    "TagG2",
    "TunnelMessage",
    "UploadG2",
    "ack_to_wire",
    "acked_command_of",
    "command_name",
    "decode",
    "detector_heartbeat",
    "generation_of",
    "heartbeat_to_wire",
    "pulse_from_wire",
    "pulse_to_wire",
    "search_report_to_wire",
    "tag_from_wire",
    "tag_of_number",
    "tag_to_wire",
]
