"""Table of topics: every kind of record exchanged between processes.

Routing, recording, the supervisor's queues and the documentation derive from this table and
from the table of processes (`uavrt.drone.supervisor.tree.table`).

A record is sent as one line, ``topic TAB json NEWLINE``.
"""

from dataclasses import KW_ONLY, dataclass
from typing import Any

import msgspec

from uavrt.config.settings import Settings
from uavrt.core import messages
from uavrt.drone.ipc.tag_assignment import Assignment


@dataclass(frozen=True, slots=True)
class Topic:
    """A kind of record: name, type, meaning, and limits."""

    name: str
    record: type
    meaning: str
    _: KW_ONLY
    newest: int | None = None
    """Number of records kept for a slow or restarting consumer; None keeps all. Older records
    are dropped and counted."""
    every_s: float | None = None
    """Usual time between two records of one sender [s]; None if irregular. A rate below half of
    the usual one is reported as too slow (`uavrt.drone.supervisor.pace`)."""
    each_tag: bool = False
    """True if records come every `every_s` for each of the sender's tags."""


TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        Topic("assignment", Assignment, "task of a starting process"),
        Topic("pulse", messages.Pulse, "a pulse that a detector found"),
        Topic(
            "search_report",
            messages.SearchReport,
            "a search without detection, with the noise floor",
            newest=200,
            every_s=1.0,
            each_tag=True,
        ),
        Topic(
            "pulse_pose",
            messages.PulsePose,
            "a pulse with the antenna's pose, or with the note that it is unknown",
        ),
        Topic("recorded", messages.Recorded, "pulses that are safely on disk"),
        Topic(
            "records_handled",
            messages.RecordsHandled,
            "number of records processed; later ones are sent again after a restart",
        ),
        Topic(
            "bearing",
            messages.LiveBearing,
            "a bearing computed on the drone, if the estimator runs",
            newest=50,
        ),
        Topic("beep", messages.Beep, "a sender of pulses found without a tag list", newest=100),
        Topic(
            "delivered",
            messages.Delivered,
            "pulses that a ground station has stored; not sent again",
        ),
        Topic(
            "poses",
            messages.Poses,
            "raw poses of the vehicle, batched",
            newest=600,
            every_s=0.5,
        ),
        Topic("flight", messages.FlightInfo, "a flight has started"),
        Topic(
            "corrected_tags",
            messages.FlightInfo,
            "the flight continues with changed tag values",
        ),
        Topic(
            "flight_end",
            messages.FlightInfo,
            "the flight has ended, and all its pulses were passed on",
        ),
        Topic("motion", messages.MotionRequest, "a motion that an operator requests", newest=1),
        Topic(
            "motion_offer",
            messages.MotionOffer,
            "a proposed motion that the operator must confirm",
            newest=1,
        ),
        Topic(
            "vehicle",
            messages.VehicleReport,
            "state of the vehicle, and authority over it",
            newest=1,
            every_s=0.1,
        ),
        Topic("vehicle_fence", messages.VehicleFence, "the autopilot's own fence", newest=1),
        Topic(
            "vehicle_request", messages.VehicleRequest, "the guide's requested motion", newest=4
        ),
        Topic("course", messages.Course, "the drone's planned path", newest=2),
        Topic(
            "neighbour",
            messages.Neighbour,
            "another drone's state, from the ground station",
            newest=32,
        ),
        Topic(
            "search_note",
            messages.SearchNote,
            "a search's decision or found tag, with the reason",
            newest=200,
        ),
        Topic("command", messages.Command, "an operator's command"),
        Topic("command_reply", messages.CommandReply, "the supervisor's answer"),
        Topic(
            "operation",
            messages.Operation,
            "progress of an operation that takes longer than its command",
        ),
        Topic("settings", Settings, "the settings after an operator has changed one", newest=1),
        Topic("status_text", messages.StatusText, "a short text for the operator", newest=100),
        Topic(
            "health",
            messages.Health,
            "state and counters of a process",
            newest=100,
            every_s=1.0,
        ),
        Topic(
            "system_status",
            messages.SystemStatus,
            "the state of the drone's programs, tags and flight",
            newest=2,
            every_s=1.0,
        ),
    )
}


def _plain(value: Any) -> Any:
    """Convert a NumPy scalar to a Python number; raises `TypeError` for other types."""
    if type(value).__module__ == "numpy" and getattr(value, "shape", None) == ():
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be sent between processes")


_encoder = msgspec.json.Encoder(enc_hook=_plain)
_decoders: dict[str, msgspec.json.Decoder[Any]] = {
    name: msgspec.json.Decoder(topic.record) for name, topic in TOPICS.items()
}


def encode_record(topic: str, record: object) -> bytes:
    """Encode a record as one line with its newline; raises `TypeError` for a wrong type."""
    if not isinstance(record, TOPICS[topic].record):
        raise TypeError(f"{topic} carries {TOPICS[topic].record.__name__}, not {record!r}")
    return topic.encode() + b"\t" + _encoder.encode(record) + b"\n"


def topic_of(line: bytes) -> str:
    """Return the topic of an encoded line, without decoding its record."""
    return line[: line.find(b"\t")].decode("ascii", "replace")


def decode_record(line: bytes) -> tuple[str, Any]:
    """Decode a line to topic and record; raises `ValueError` for an unknown topic or record."""
    name, separator, body = line.partition(b"\t")
    topic = name.decode("ascii", "replace")
    decoder = _decoders.get(topic)
    if not separator or decoder is None:
        raise ValueError(f"the line is not a record: {line[:80]!r}")
    try:
        return topic, decoder.decode(body)
    except msgspec.MsgspecError as error:
        raise ValueError(f"the line is not a record of topic {topic}: {error}") from error
