"""The way onto the network: a DDS participant that ROS 2 takes for our nodes.

How ROS 2 recognises nodes, topics and types of a foreign participant, and what must not be done
with the binding, was found by experiment against ROS 2 Jazzy (reference/ros2.md §0 and §1.2):

- topics have the prefix ``rt/``, types the infix ``::msg::dds_::``, participants the user data
  ``enclave=/;``, endpoints their type hash;
- node names come from ``ros_discovery_info``, written anew whenever an endpoint is added;
- samples are read by one thread with a wait set: listeners of the binding deadlock;
- writers keep the last few messages: with "keep all" a stopped subscriber stops the writer.

Samples go in and out as bytes; `uavrt.ros2.cdr` makes and reads them, five times faster than
the binding (reference/ros2.md §1.4), and what a stranger sends is judged by our own reader.
"""

import os
import threading
import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any

from cyclonedds.core import (
    DDSException,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from uavrt.config.settings import Ros2Settings
from uavrt.errors import ConfigError, LinkError
from uavrt.ros2 import messages
from uavrt.ros2.cdr import encode
from uavrt.ros2.graph import LOG_DEPTH, LOG_MESSAGE, LOG_TOPIC, NODES, TOPICS, RosTopic
from uavrt.ros2.interface import Field, dds_name, fields_of, type_hash
from uavrt.ros2.messages import RosMessage

DISCOVERY_TOPIC = "ros_discovery_info"
WRITE_TIMEOUT_MS = 100
"""A write gives up after this; with few messages kept it never has to wait in practice."""
RECEIVED_LIMIT = 400
"""Messages that may wait for us; more, from a publisher gone wild, are dropped and counted."""
TAKE_AT_ONCE = 64
READ_PAUSE_S = 0.02
"""Rest of the reading thread after each round: bounds what a flood can cost."""
GOODBYE_S = 0.2
"""Time for the empty list of nodes to be acknowledged; then the nodes vanish at once."""


class Sample:
    """The bytes of a message, as the binding hands them over."""

    sample_info: Any

    def __init__(self, cdr: bytes) -> None:
        self.cdr = cdr


_DDS_TYPES: dict[type, Any] = {}


def dds_type(message: type[RosMessage]) -> Any:
    """Get the DDS type of a message; its instances carry bytes that are ready to be sent."""
    if message not in _DDS_TYPES:
        _DDS_TYPES[message] = _make_dds_type(message)
    return _DDS_TYPES[message]


def _make_dds_type(message: type[RosMessage]) -> Any:
    struct = make_idl_struct(
        message.__name__,
        dds_name(message).replace("::", "."),
        {entry.name: _idl_type(entry) for entry in fields_of(message)},
    )
    struct.serialize = lambda self, *_, **__: self.cdr
    struct.deserialize = classmethod(lambda _, data, *__, **___: Sample(data))
    struct.deserialize_key = classmethod(lambda _, data, *__, **___: Sample(data))
    return struct


def _idl_type(entry: Field) -> Any:
    if entry.message is not None:
        nested = dds_type(entry.message)
        return types.sequence[nested] if entry.sequence else nested
    if entry.length is not None:
        return types.array[types.uint8, entry.length]
    if entry.primitive == "string<=256":
        return types.bounded_str[256]
    return {
        "bool": bool,
        # Release 0.10.5 has one name for both; the octet on the wire is the same.
        "byte": getattr(types, "byte", types.uint8),
        "uint8": types.uint8,
        "uint16": types.uint16,
        "int32": types.int32,
        "uint32": types.uint32,
        "float64": types.float64,
        "string": str,
    }[entry.primitive]


def domain_id_of(settings: Ros2Settings, environment: Mapping[str, str]) -> int:
    """Get the ROS domain: from the settings, else from ROS_DOMAIN_ID, else 0.

    Raises
    ------
    ConfigError
        ROS_DOMAIN_ID is not a domain.
    """
    if settings.domain_id is not None:
        return settings.domain_id
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isascii() or not text.isdigit() or int(text) > 232:
        raise ConfigError(
            f"ROS_DOMAIN_ID is {text!r}", remedy="Set it to a whole number from 0 to 232"
        )
    return int(text)


def cyclone_config(interfaces: tuple[str, ...]) -> str:
    """Write Cyclone DDS's configuration: the loopback, and these interfaces.

    The loopback is always in it, and named as a peer: else ROS 2 on the same computer, when it
    is itself bound to the loopback, is not found (reference/ros2.md §1.3).
    """
    named = "".join(f'<NetworkInterface name="{name}"/>' for name in interfaces)
    return (
        "<CycloneDDS><Domain><General><Interfaces>"
        f'{named}<NetworkInterface address="127.0.0.1" multicast="true"/>'
        "</Interfaces></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        '<Peers><Peer address="localhost"/></Peers></Discovery></Domain></CycloneDDS>'
    )


def _qos(*, depth: int, message: type[RosMessage] | None, keep: bool = False) -> list[Any]:
    """Get the quality of service of ROS 2: reliable, the last `depth` messages."""
    policies = [
        Policy.Reliability.Reliable(duration(milliseconds=WRITE_TIMEOUT_MS)),
        Policy.Durability.TransientLocal if keep else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    ]
    if message is not None:
        policies.append(Policy.Userdata(f"typehash={type_hash(message)};".encode()))
    return policies


def _writer_qos(*, depth: int, message: type[RosMessage] | None, keep: bool = False) -> Any:
    policies = _qos(depth=depth, message=message, keep=keep)
    policies.append(Policy.WriterDataLifecycle(autodispose=False))
    if keep:
        policies.append(
            Policy.DurabilityService(
                cleanup_delay=0,
                history=Policy.History.KeepLast(depth),
                max_samples=-1,
                max_instances=-1,
                max_samples_per_instance=-1,
            )
        )
    return Qos(*policies)


class Participant:
    """Our nodes and their endpoints on the network.

    Parameters
    ----------
    settings : Ros2Settings
        Interfaces, domain, size of identifiers.
    environment : mapping
        ROS_DOMAIN_ID; CYCLONEDDS_URI, which replaces our configuration of the network.
    nodes : collection of str
        Of `uavrt.ros2.graph.NODES`: a lone detector on another computer is one of them.

    Raises
    ------
    ConfigError
        ROS_DOMAIN_ID is not a domain.
    LinkError
        The network cannot be used like this.
    """

    def __init__(
        self,
        settings: Ros2Settings,
        environment: Mapping[str, str] = os.environ,
        nodes: Collection[str] = tuple(NODES),
    ) -> None:
        self.domain_id = domain_id_of(settings, environment)
        self.dropped = 0
        """Received messages that nobody had time for."""
        self.unsent = 0
        """Messages that could not be written."""
        self._gid_bytes = settings.gid_bytes
        self._received: deque[tuple[RosTopic, bytes]] = deque()
        self._closing = threading.Event()
        try:
            self._open(settings, environment, nodes)
        except DDSException as error:
            raise LinkError(
                f"ROS 2 cannot be joined: {error}",
                remedy="Check [ros2] interfaces, CYCLONEDDS_URI and the loopback interface",
            ) from error
        self._thread = threading.Thread(target=self._read, name="ros2-reader", daemon=True)
        self._thread.start()

    def _open(
        self, settings: Ros2Settings, environment: Mapping[str, str], nodes: Collection[str]
    ) -> None:
        if not environment.get("CYCLONEDDS_URI"):
            self._domain = Domain(self.domain_id, cyclone_config(settings.interfaces))
        self._participant = DomainParticipant(
            self.domain_id, qos=Qos(Policy.Userdata(b"enclave=/;"))
        )
        self._publisher = Publisher(self._participant)
        self._subscriber = Subscriber(self._participant)
        self._topics: dict[str, Any] = {}
        self._writers: dict[tuple[str, str], Any] = {}
        self._readers: list[tuple[str, RosTopic, Any]] = []
        self._waitset = WaitSet(self._participant)
        for topic in TOPICS.values():
            if topic.publisher in nodes:
                self._add_writer(topic.publisher, topic.name, topic.message, topic.depth)
            for node in nodes:
                if node in topic.subscribers:
                    self._add_reader(node, topic)
        for node in nodes:
            self._add_writer(node, LOG_TOPIC, LOG_MESSAGE, LOG_DEPTH, keep=True)
        info = self._info_type()
        self._info_writer = DataWriter(
            self._publisher,
            Topic(self._participant, DISCOVERY_TOPIC, dds_type(info)),
            qos=_writer_qos(depth=1, message=None, keep=True),
        )
        self._introduce(nodes)

    # ------------------------------------------------------------------ sending

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message; `node` only where several publish the topic (``rosout``)."""
        publisher = node or TOPICS[topic].publisher
        self._write(self._writers[publisher, topic], message)

    def _write(self, writer: Any, message: RosMessage) -> None:
        kind = dds_type(type(message))
        sample = kind.__new__(kind)
        sample.cdr = encode(message)
        try:
            writer.write(sample)
        except DDSException:
            self.unsent += 1

    # ---------------------------------------------------------------- receiving

    def take(self, limit: int) -> list[tuple[RosTopic, bytes]]:
        """Get up to `limit` messages that have arrived, as their topic and CDR bytes."""
        return [self._received.popleft() for _ in range(min(limit, len(self._received)))]

    def _read(self) -> None:
        """Take in samples until the end; the only reader (a thread of its own)."""
        while not self._closing.is_set():
            try:
                if self._waitset.wait(duration(milliseconds=200)):
                    self._read_once()
                    time.sleep(READ_PAUSE_S)
            except DDSException:
                self.dropped += 1
                time.sleep(READ_PAUSE_S)

    def _read_once(self) -> None:
        for _, topic, reader in self._readers:
            for sample in reader.take(TAKE_AT_ONCE):
                if not isinstance(sample, Sample):
                    continue  # a publisher has gone; there is no message
                if len(self._received) < RECEIVED_LIMIT:
                    self._received.append((topic, sample.cdr))
                else:
                    self.dropped += 1

    # -------------------------------------------------------------------- nodes

    def _add_writer(
        self, node: str, name: str, message: type[RosMessage], depth: int, keep: bool = False
    ) -> None:
        qos = _writer_qos(depth=depth, message=message, keep=keep)
        topic = self._topic(name, message)
        self._writers[node, name] = DataWriter(self._publisher, topic, qos=qos)

    def _add_reader(self, node: str, topic: RosTopic) -> None:
        policies = _qos(depth=topic.depth, message=topic.message)
        # What we publish ourselves is not news to us.
        qos = Qos(*policies, Policy.IgnoreLocal.Process)
        reader = DataReader(self._subscriber, self._topic(topic.name, topic.message), qos=qos)
        condition = ReadCondition(
            reader, SampleState.NotRead | ViewState.Any | InstanceState.Any
        )
        self._waitset.attach(condition)
        self._readers.append((node, topic, reader))

    def _topic(self, name: str, message: type[RosMessage]) -> Any:
        if name not in self._topics:
            self._topics[name] = Topic(self._participant, f"rt/{name}", dds_type(message))
        return self._topics[name]

    def _info_type(self) -> Any:
        if self._gid_bytes == 16:
            return messages.ParticipantEntitiesInfo16
        return messages.ParticipantEntitiesInfo24

    def _introduce(self, nodes: Collection[str]) -> None:
        """Tell ROS 2 which nodes there are and what is theirs."""
        wide = self._gid_bytes == 24
        gid: Any = messages.Gid24 if wide else messages.Gid16
        node_info: Any = messages.NodeEntitiesInfo24 if wide else messages.NodeEntitiesInfo16

        def gid_of(entity: Any) -> Any:
            return gid(data=entity.guid.bytes.ljust(self._gid_bytes, b"\0"))

        self._write(
            self._info_writer,
            self._info_type()(
                gid=gid_of(self._participant),
                node_entities_info_seq=tuple(
                    node_info(
                        node_name=node,
                        reader_gid_seq=tuple(
                            gid_of(r) for n, _, r in self._readers if n == node
                        ),
                        writer_gid_seq=tuple(
                            gid_of(w) for (n, _), w in self._writers.items() if n == node
                        ),
                    )
                    for node in nodes
                ),
            ),
        )

    def close(self) -> None:
        """Say goodbye and leave; without it the nodes would linger for ten seconds."""
        self._closing.set()
        self._thread.join(2.0)
        self._introduce(())
        try:
            self._info_writer.wait_for_acks(duration(milliseconds=round(GOODBYE_S * 1e3)))
        except DDSException:
            self.unsent += 1
        del self._waitset, self._info_writer
        self._writers.clear()
        self._readers.clear()
        self._topics.clear()
        del self._publisher, self._subscriber, self._participant
        self.__dict__.pop("_domain", None)
