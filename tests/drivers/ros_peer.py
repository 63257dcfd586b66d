"""The ROS 2 gateway process, and a participant on its network that shares no code with ours.

The participant takes the messages from the ament package's files and from `rosbags`, which also
makes and reads its bytes; ours are made by `uavrt.link.ros2.types.cdr`. Everything stays on the
loopback.
"""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from until import until

from uavrt.config.settings import Settings
from uavrt.core.clock import Clock
from uavrt.core.messages import FlightInfo
from uavrt.drone.ipc.record_link import LINK_VARIABLE, LineBuffer
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import decode_record, encode_record
from uavrt.link.ros2.types.ros_messages import RosTag

INTERFACES = Path(__file__).parents[2] / "ros" / "uavrt_interfaces" / "msg"
LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces>"
    '<NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces></General>'
    "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    '<Peers><Peer address="localhost"/></Peers></Discovery></Domain></CycloneDDS>'
)


ARRAY = "diagnostic_msgs/msg/DiagnosticArray"
KINDS = {
    "antenna_pose": "geometry_msgs/msg/PoseStamped",
    "burst": "uavrt_interfaces/msg/Burst",
    "pulse": "uavrt_interfaces/msg/Pulse",
    "pulse_pose": "uavrt_interfaces/msg/PulsePose",
    "release_tag_information": "std_msgs/msg/Bool",
    "ros_discovery_info": "rmw_dds_common/msg/ParticipantEntitiesInfo",
    "rosout": "rcl_interfaces/msg/Log",
    "store_coded_tag_information": "uavrt_interfaces/msg/CodedTag",
    "store_tag_information": "uavrt_interfaces/msg/Tag",
}
"""Type of each topic's messages; all others carry `ARRAY`."""
KEPT = ("ros_discovery_info", "rosout")
"""Topics whose publishers send to late readers what they published before."""


def kind_of(topic: str) -> str:
    """Type of the messages of a topic in any namespace."""
    return KINDS.get(topic.rpartition("/")[2], ARRAY)


class RosPeer:
    """Listens and publishes like any ROS 2 program."""

    def __init__(self, domain_id: int) -> None:
        from cyclonedds.core import Policy, Qos
        from cyclonedds.domain import Domain, DomainParticipant
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.types = get_typestore(Stores.ROS2_JAZZY)
        for path in INTERFACES.glob("*.msg"):
            name = f"uavrt_interfaces/msg/{path.stem}"
            self.types.register(get_types_from_msg(path.read_text(encoding="utf-8"), name))
        self._domain = Domain(domain_id, LOOPBACK)
        self._participant = DomainParticipant(
            domain_id, qos=Qos(Policy.Userdata(b"enclave=/;"))
        )
        self._structs: dict[str, Any] = {}
        self._topics: dict[str, Any] = {}
        self._writers: dict[str, Any] = {}

    def new(self, name: str, *values: object) -> Any:
        """Make a message by its full name and its fields in order."""
        return self.types.types[name](*values)

    def numbers(self, values: Sequence[float]) -> Any:
        """Make a sequence of numbers as the messages have them."""
        import numpy as np

        return np.asarray(values, dtype=np.float64)

    def listen(self, topic: str) -> "Listener":
        """Subscribe like `ros2 topic echo`."""
        return Listener(self, topic)

    def reader(self, topic: str) -> Any:
        """Get the reader itself."""
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.util import duration

        qos = Qos(
            Policy.Reliability.Reliable(duration(seconds=1)),
            Policy.Durability.TransientLocal if topic in KEPT else Policy.Durability.Volatile,
            Policy.History.KeepLast(1000),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        return DataReader(self._participant, self._topic(topic), qos=qos)

    def advertise(self, *topics: str, subscribers: int = 1, depth: int = 200) -> None:
        """Make publishers like `ros2 topic pub -w N`; wait until so many listen to each."""
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter
        from cyclonedds.util import duration

        qos = Qos(
            Policy.Reliability.Reliable(duration(seconds=1)),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(depth),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            Policy.WriterDataLifecycle(autodispose=False),
        )
        for topic in topics:
            self._writers[topic] = DataWriter(self._participant, self._topic(topic), qos=qos)

        def heard() -> bool:
            writers = [self._writers[topic] for topic in topics]
            return all(len(one.get_matched_subscriptions()) >= subscribers for one in writers)

        until(heard)

    def publish_bytes(self, topic: str, cdr: bytes) -> None:
        """Publish bytes as they are, sense or nonsense."""
        writer = self._writers[topic]
        sample = writer.data_type.__new__(writer.data_type)
        sample.cdr = cdr
        writer.write(sample)

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of `new`."""
        cdr = self.types.serialize_cdr(message, message.__msgtype__)
        self.publish_bytes(topic, bytes(cdr))

    def publish_first(self, topic: str, message: Any) -> None:
        """Publish a message and wait until it was received.

        A reader that has not noticed this publisher yet gets its messages a moment later, after
        those of a publisher that it knows.
        """
        from cyclonedds.util import duration

        self.publish(topic, message)
        assert self._writers[topic].wait_for_acks(duration(seconds=30))

    def order(self, what: str, **values: str) -> Any:
        """Make what an operator publishes to start or stop."""
        stamp = self.new("builtin_interfaces/msg/Time", 0, 0)
        header = self.new("std_msgs/msg/Header", stamp, "by hand")
        pairs = [self.new("diagnostic_msgs/msg/KeyValue", *pair) for pair in values.items()]
        status = self.new(
            "diagnostic_msgs/msg/DiagnosticStatus", 0, "NA", what, f"{what} all", pairs
        )
        return self.new("diagnostic_msgs/msg/DiagnosticArray", header, [status])

    def release(self, *, now: bool = True) -> Any:
        """Make what an operator publishes to release the tags."""
        return self.new("std_msgs/msg/Bool", now)

    def tag(self, tag: RosTag | None = None) -> Any:
        """Make a tag to be stored; without one, a message that no tag can have."""
        values = [0] * 9 if tag is None else [getattr(tag, name) for name in RosTag.__slots__]
        return self.new("uavrt_interfaces/msg/Tag", *values)

    def read(self, cdr: bytes, topic: str) -> Any:
        """Read bytes as a message of a topic."""
        return self.types.deserialize_cdr(cdr, kind_of(topic))

    def endpoints(self) -> dict[str, Any]:
        """All publishers on the network that are not ours, by the name of their topic."""
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication

        reader = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        own = self._participant.guid
        return {s.topic_name: s for s in reader.read(500) if s.participant_key != own}

    def _topic(self, topic: str) -> Any:
        from cyclonedds.topic import Topic

        if topic not in self._topics:
            name = topic if topic == "ros_discovery_info" else f"rt/{topic}"
            self._topics[topic] = Topic(self._participant, name, self._struct(kind_of(topic)))
        return self._topics[topic]

    def _struct(self, type_name: str) -> Any:
        """The DDS type of a message, made from the definitions that `rosbags` has."""
        from cyclonedds.idl import make_idl_struct

        if type_name not in self._structs:
            package, _, short = type_name.split("/")
            _, fields = self.types.fielddefs[type_name]
            struct: Any = make_idl_struct(
                short,
                f"{package}.msg.dds_.{short}_",
                {name: self._idl(definition) for name, definition in fields},
            )
            struct.serialize = lambda self, *_, **__: self.cdr
            struct.deserialize = classmethod(lambda _, data, *__, **___: _Raw(data))
            struct.deserialize_key = classmethod(lambda _, data, *__, **___: _Raw(data))
            self._structs[type_name] = struct
        return self._structs[type_name]

    def _idl(self, definition: Any) -> Any:
        from cyclonedds.idl import types

        kind, what = definition
        match kind.name:
            case "BASE" if what[0] == "string":
                return types.bounded_str[what[1]] if what[1] else str
            case "BASE":
                plain = {"bool": bool, "byte": types.byte, "char": types.uint8}
                return plain.get(what[0]) or getattr(types, what[0])
            case "NAME":
                return self._struct(what)
            case "ARRAY":
                return types.array[self._idl(what[0]), what[1]]
            case _:
                return types.sequence[self._idl(what[0])]

    def close(self) -> None:
        """Leave the network."""
        self._writers.clear()
        self._topics.clear()
        del self._participant, self._domain


class Listener:
    """A subscription, and what came by it."""

    def __init__(self, peer: RosPeer, topic: str) -> None:
        self._peer, self._topic, self._reader = peer, topic, peer.reader(topic)

    def __call__(self) -> list[bytes]:
        """Bytes that came since."""
        return [s.cdr for s in self._reader.take(1000) if hasattr(s, "cdr")]

    def messages(self) -> list[Any]:
        """Messages that came since."""
        return [self._peer.read(cdr, self._topic) for cdr in self()]

    def collect(
        self,
        complete: Callable[[list[bytes]], bool] = bool,
        meanwhile: Callable[[], object] = bool,
    ) -> list[bytes]:
        """Wait until what came is complete; by default, until something did.

        What is done meanwhile is done again and again: a writer may not know us yet.
        """
        found: list[bytes] = []

        def enough() -> bool:
            meanwhile()
            found.extend(self())
            return bool(found) and complete(found)

        until(enough)
        return found

    def newest(
        self,
        wanted: Callable[[Any], object] = lambda _: True,
        meanwhile: Callable[[], object] = bool,
    ) -> Any:
        """Wait for something; the newest message, once it is as wanted."""

        def read(cdr: bytes) -> Any:
            return self._peer.read(cdr, self._topic)

        return read(self.collect(lambda got: bool(wanted(read(got[-1]))), meanwhile)[-1])


class _Raw:
    """Bytes of a sample; the binding adds an attribute."""

    sample_info: Any

    def __init__(self, cdr: bytes) -> None:
        self.cdr = cdr


class GatewayProcess:
    """The real gateway process, with us in the supervisor's place."""

    def __init__(
        self,
        settings: Settings,
        flight: FlightInfo | None = None,
        prefix: tuple[str, ...] = (),
        **environment: str,
    ) -> None:
        self._sock, theirs = socket.socketpair()
        self._lines = LineBuffer()
        self.clock = Clock.start()
        with theirs:
            self.process = subprocess.Popen(
                [*prefix, sys.executable, "-m", "uavrt.drone.processes.ros2_gateway"],
                pass_fds=(theirs.fileno(),),
                env=os.environ | {LINK_VARIABLE: str(theirs.fileno())} | environment,
            )
        self.send(
            "assignment",
            Assignment(
                process="ros2",
                settings=settings,
                clock_offset_ns=self.clock.offset_ns,
                flight=flight,
            ),
        )

    def send(self, topic: str, record: object) -> None:
        self._sock.sendall(encode_record(topic, record))

    def receive(self, topic: str, count: int = 1, timeout_s: float = 30.0) -> list[Any]:
        """The next records of a topic; others are passed over."""
        found: list[Any] = []
        deadline_s = time.monotonic() + timeout_s
        while len(found) < count:
            self._sock.settimeout(max(0.01, deadline_s - time.monotonic()))
            data = self._sock.recv(1 << 16)
            assert data, "the gateway has ended"
            for line in self._lines.feed(data):
                name, record = decode_record(line)
                found += [record] * (name == topic)
        return found

    def counters(self) -> dict[str, float]:
        """What it says next that it has counted."""
        return dict(self.receive("health")[0].counters)

    def close(self) -> int:
        """Ask it to end; get its exit code."""
        self.process.terminate()
        try:
            return self.process.wait(30.0)
        finally:
            self.process.kill()
            self.process.wait()
            self._sock.close()
