"""The table of topics: every kind of record that crosses a process.

Routing, recording, the hub's queues and the documentation derive from this table and from the
table of processes (`uavrt.supervisor.tree.table`).

A record travels as one line, ``topic TAB json NEWLINE``.
"""

from dataclasses import dataclass
from typing import Any

import msgspec

from uavrt import messages
from uavrt.config.settings import Settings
from uavrt.ipc.assignment import Assignment


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """One row of the table."""

    name: str
    record: type
    meaning: str
    newest: int | None = None
    """Number of newest records kept for a slow or restarting consumer; None: all. Older ones
    are dropped and counted."""
    every_s: float | None = None
    """Time between two records of one sender once they flow [s]; None: irregular. Less than
    half the rate is reported as too slow (`uavrt.supervisor.pace`)."""
    each_tag: bool = False
    """Whether `every_s` applies to each tag that the sender serves."""


TOPICS: dict[str, Topic] = {
    topic.name: topic
    for topic in (
        Topic(
            name="assignment",
            record=Assignment,
            meaning="what a starting process is to do; its first record",
        ),
        Topic(name="pulse", record=messages.Pulse, meaning="a pulse that a detector found"),
        Topic(
            name="search_report",
            record=messages.SearchReport,
            meaning="searched, nothing found, with the noise floor",
            newest=200,
            every_s=1.0,
            each_tag=True,
        ),
        Topic(
            name="pulse_pose",
            record=messages.PulsePose,
            meaning="a pulse with the antenna's pose, or the word that there is none",
        ),
        Topic(
            name="recorded", record=messages.Recorded, meaning="which of them are safe on disk"
        ),
        Topic(
            name="taken",
            record=messages.Taken,
            meaning="how many records are dealt with for good; the rest would be sent again",
        ),
        Topic(
            name="bearing",
            record=messages.LiveBearing,
            meaning="a bearing estimated on the drone, where its table has the estimator",
            newest=50,
        ),
        Topic(
            name="beep",
            record=messages.Beep,
            meaning="a sender of pulses that was found without knowing any tag",
            newest=100,
        ),
        Topic(
            name="delivered",
            record=messages.Delivered,
            meaning="pulses that reached a ground station, never to be sent again",
        ),
        Topic(
            name="poses",
            record=messages.Poses,
            meaning="raw poses of the vehicle, batched",
            newest=600,
            every_s=0.5,
        ),
        Topic(name="flight", record=messages.FlightInfo, meaning="a flight has started"),
        Topic(
            name="corrected_tags",
            record=messages.FlightInfo,
            meaning="the flight goes on with other values of its tags",
        ),
        Topic(
            name="flight_end",
            record=messages.FlightInfo,
            meaning="the flight has ended and all its pulses are on their way",
        ),
        Topic(
            name="motion",
            record=messages.MotionRequest,
            meaning="a motion that an operator asks for",
            newest=1,
        ),
        Topic(
            name="motion_offer",
            record=messages.MotionOffer,
            meaning="what would be flown, for the operator to confirm",
            newest=1,
        ),
        Topic(
            name="vehicle",
            record=messages.VehicleReport,
            meaning="the vehicle and our say over it",
            newest=1,
            every_s=0.1,
        ),
        Topic(
            name="vehicle_fence",
            record=messages.VehicleFence,
            meaning="the autopilot's own fence",
            newest=1,
        ),
        Topic(
            name="wish",
            record=messages.VehicleWish,
            meaning="what the guide wishes of the vehicle",
            newest=4,
        ),
        Topic(
            name="course",
            record=messages.Course,
            meaning="where the drone is going, for others that fly",
            newest=2,
        ),
        Topic(
            name="neighbour",
            record=messages.Neighbour,
            meaning="another drone's state, from the ground station",
            newest=32,
        ),
        Topic(
            name="search_note",
            record=messages.SearchNote,
            meaning="what a search has decided or found, and why",
            newest=200,
        ),
        Topic(name="command", record=messages.Command, meaning="what an operator asks"),
        Topic(
            name="command_reply",
            record=messages.CommandReply,
            meaning="the supervisor's answer",
        ),
        Topic(
            name="operation",
            record=messages.Operation,
            meaning="how far something is that takes longer than its command",
        ),
        Topic(
            name="settings",
            record=Settings,
            meaning="the settings after an operator has changed one",
            newest=1,
        ),
        Topic(
            name="status_text",
            record=messages.StatusText,
            meaning="a short text for the operator",
            newest=100,
        ),
        Topic(
            name="health",
            record=messages.Health,
            meaning="what a process says of itself",
            newest=100,
            every_s=1.0,
        ),
        Topic(
            name="system_status",
            record=messages.SystemStatus,
            meaning="the state of the drone side",
            newest=2,
            every_s=1.0,
        ),
    )
}


def _plain(value: Any) -> Any:
    """Turn a NumPy scalar into a Python number; other types are refused."""
    if type(value).__module__ == "numpy" and getattr(value, "shape", None) == ():
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot travel between processes")


_encoder = msgspec.json.Encoder(enc_hook=_plain)
_decoders: dict[str, msgspec.json.Decoder[Any]] = {
    name: msgspec.json.Decoder(topic.record) for name, topic in TOPICS.items()
}


def encode_record(topic: str, record: object) -> bytes:
    """Write a record as one line with its newline; raises `TypeError` for a wrong type."""
    if not isinstance(record, TOPICS[topic].record):
        raise TypeError(f"{topic} carries {TOPICS[topic].record.__name__}, not {record!r}")
    return topic.encode() + b"\t" + _encoder.encode(record) + b"\n"


def topic_of(line: bytes) -> str:
    """Get the topic of a line without reading the record."""
    return line[: line.find(b"\t")].decode("ascii", "replace")


def decode_record(line: bytes) -> tuple[str, Any]:
    """Read a line into topic and record; raises `ValueError` for an unknown topic or record."""
    name, separator, body = line.partition(b"\t")
    topic = name.decode("ascii", "replace")
    decoder = _decoders.get(topic)
    if not separator or decoder is None:
        raise ValueError(f"not a record: {line[:80]!r}")
    try:
        return topic, decoder.decode(body)
    except msgspec.MsgspecError as error:
        raise ValueError(f"not a {topic} record: {error}") from error
