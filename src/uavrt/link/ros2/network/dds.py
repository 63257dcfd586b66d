"""A DDS participant on the network, which ROS 2 shows as the nodes of the drone.

How ROS 2 recognises nodes, topics and types of a foreign participant, and the limits of the
binding, were found by experiment against ROS 2 Jazzy:

- topics have the prefix ``rt/``, types the infix ``::msg::dds_::``, participants the user data
  ``enclave=/;``, endpoints their type hash;
- node names come from ``ros_discovery_info``, rewritten whenever an endpoint is added;
- samples are read by one thread with a wait set: listeners of the binding deadlock;
- writers keep the last few messages: with "keep all" a stopped subscriber stops the writer.

Samples go in and out as bytes. `uavrt.link.ros2.types.cdr` makes and reads them, five times
faster than the binding, and checks received ones.
"""

import os
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Literal
from xml.sax.saxutils import escape, quoteattr

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
)
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
from uavrt.core.errors import ConfigError, LinkError
from uavrt.core.log import get_logger
from uavrt.link.ros2.graph import (
    LOG_DEPTH,
    LOG_MESSAGE,
    LOG_TOPIC,
    NODES,
    PARAMETER_NODE,
    SERVICE_BURST,
    SERVICE_PER_S,
    TELEMETRY,
    TOPICS,
    RosTopic,
)
from uavrt.link.ros2.inbox import Inbox, SendingOrder
from uavrt.link.ros2.network.dds_warnings import DdsWarnings
from uavrt.link.ros2.ros_senders import DETECTOR_MARK, GATEWAY_MARK, Arrival, Senders
from uavrt.link.ros2.types import ros_messages as messages
from uavrt.link.ros2.types.cdr import encode
from uavrt.link.ros2.types.interface import Field, dds_name, fields_of, type_hash
from uavrt.link.ros2.types.parameter_messages import SERVICES, ServiceMessage
from uavrt.link.ros2.types.ros_messages import RosMessage

log = get_logger()

DISCOVERY_TOPIC = "ros_discovery_info"
WRITE_TIMEOUT_MS = 100
"""Time limit of a DDS write [ms]. In practice a write does not wait, because few messages are
kept."""
SAMPLE_MB = 4
"""Longest message that DDS assembles from fragments [MB], several times the longest message of
any topic. The fragments of longer messages are dropped with a warning."""
READER_DEPTH = 4000
"""Largest number of messages waiting in a topic's reader: 0.4 s at 10 000 a second."""
PASSES = 3
"""Largest number of passes over all topic readers per round while messages still wait."""
ANNOUNCED_LIMIT = 2000
"""Largest number of announced participants and publishers that are read at once."""
SERVICE_DEPTH = 100
READ_PAUSE_S = 0.02
"""Pause of the DDS reading thread after each round [s]; during a flood it reads many messages
at once."""
ORDER_OF_USE = {
    "store_tag_information": 0,
    "store_coded_tag_information": 0,
    "release_tag_information": 1,
}
"""Order in which messages with the same time stamp are handled: tags, then the end of the
upload, then a start command."""
GOODBYE_S = 0.2
"""Longest wait at shutdown until other participants have acknowledged the empty list of nodes
[s]."""


Reach = Literal["interfaces", "computer", "off"]


class Sample:
    """The bytes of a message, as the DDS binding returns them."""

    sample_info: Any

    def __init__(self, cdr: bytes) -> None:
        self.cdr = cdr


_DDS_TYPES: dict[type, Any] = {}


def dds_type(message: type[RosMessage]) -> Any:
    """Make the DDS type of a message class; its instances hold bytes ready to be sent."""
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
    plain = _plain_type(entry.primitive)
    return types.sequence[plain] if entry.sequence else plain


def _plain_type(primitive: str) -> Any:
    return {
        "bool": bool,
        # Release 0.10.5 has one name for both; the octet on the wire is the same.
        "byte": getattr(types, "byte", types.uint8),
        "uint8": types.uint8,
        "uint16": types.uint16,
        "int32": types.int32,
        "uint32": types.uint32,
        "int64": types.int64,
        "uint64": types.uint64,
        "float64": types.float64,
        "string": str,
    }[primitive]


def domain_id_of(settings: Ros2Settings, environment: Mapping[str, str]) -> int:
    """Return the number of the ROS domain: from the settings, otherwise from ROS_DOMAIN_ID,
    otherwise 0. Raises `ConfigError` for an invalid number.
    """
    if settings.domain_id is not None:
        return settings.domain_id
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isascii() or not text.isdigit() or int(text) > 232:
        raise ConfigError(
            f"ROS_DOMAIN_ID {text!r} is invalid", remedy="Set a whole number from 0 to 232"
        )
    return int(text)


def reach_of(environment: Mapping[str, str]) -> Reach:
    """Return how far ROS 2's environment variables let the nodes be visible on the network,
    within what `interfaces` allow.

    ROS_LOCALHOST_ONLY (Humble) overrides ROS_AUTOMATIC_DISCOVERY_RANGE, as in ROS 2.
    """
    if environment.get("ROS_LOCALHOST_ONLY", "").strip() == "1":
        return "computer"
    text = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").strip()
    reaches: dict[str, Reach] = {
        "": "interfaces",
        "SYSTEM_DEFAULT": "interfaces",
        "SUBNET": "interfaces",
        "LOCALHOST": "computer",
        "OFF": "off",
    }
    if text not in reaches:
        raise ConfigError(
            f"ROS_AUTOMATIC_DISCOVERY_RANGE {text!r} is not supported",
            remedy="Set it to SUBNET, LOCALHOST or OFF, or unset it",
        )
    return reaches[text]


def cyclone_config(
    interfaces: tuple[str, ...], reach: Reach = "interfaces", warnings_path: str = ""
) -> str:
    """Make the Cyclone DDS configuration for the loopback and the given interfaces.

    The loopback is always included and listed as a peer, so that ROS 2 programs that only use
    the loopback are found. Only participants with the same tag find each other.
    """
    wanted = interfaces if reach == "interfaces" else ()
    named = "".join(f"<NetworkInterface name={quoteattr(name)}/>" for name in wanted)
    tracing = (
        f"<Tracing><Verbosity>warning</Verbosity><OutputFile>{escape(warnings_path)}"
        "</OutputFile><AppendToFile>true</AppendToFile></Tracing>"
        if warnings_path
        else ""
    )
    tag = f"<Tag>uavrt-off-{os.getpid()}</Tag>" if reach == "off" else ""
    return (
        "<CycloneDDS><Domain><General><Interfaces>"
        f'{named}<NetworkInterface address="127.0.0.1" multicast="true"/>'
        "</Interfaces></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
        f"{tag}<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
        '<Peers><Peer address="localhost"/></Peers></Discovery>'
        f"<Internal><MaxSampleSize>{SAMPLE_MB} MB</MaxSampleSize></Internal>"
        f"{tracing}</Domain></CycloneDDS>"
    )


def _reply_name(message: type[RosMessage]) -> str:
    """Return the key of a service's reply writer among this participant's writers."""
    return f"reply {message.ros_name}"


def _qos(
    *, depth: int, message: type[RosMessage], keep: bool = False, mark: str = ""
) -> list[Any]:
    """Make ROS 2's quality of service: reliable, with the last `depth` messages kept."""
    policies = [
        Policy.Reliability.Reliable(duration(milliseconds=WRITE_TIMEOUT_MS)),
        Policy.Durability.TransientLocal if keep else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"{mark}typehash={type_hash(message)};".encode()),
    ]
    return policies


def _writer_qos(
    *, depth: int, message: type[RosMessage], keep: bool = False, mark: str = ""
) -> Any:
    policies = _qos(depth=depth, message=message, keep=keep, mark=mark)
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


def _user_data(qos: Any) -> bytes:
    """User data that a participant announces; empty if there are none."""
    if qos is None or Policy.Userdata not in qos:
        return b""
    return bytes(qos[Policy.Userdata].data)


class Participant:
    """The drone's ROS 2 nodes and their endpoints on the network.

    `settings`: interfaces, domain, namespace, size of identifiers. `environment`:
    ROS_DOMAIN_ID, ROS_LOCALHOST_ONLY, ROS_AUTOMATIC_DISCOVERY_RANGE; CYCLONEDDS_URI replaces
    `cyclone_config`. `nodes`: some of `uavrt.link.ros2.graph.NODES`; only one for a detector on
    another computer. `names`: replacements of these node names. Raises `ConfigError` for an
    invalid variable, `LinkError` if the network cannot be used.
    """

    def __init__(
        self,
        settings: Ros2Settings,
        environment: Mapping[str, str] = os.environ,
        nodes: Collection[str] = tuple(NODES),
        names: Mapping[str, str] | None = None,
    ) -> None:
        self._namespace = settings.namespace.strip("/")
        self._names = names or {}
        self.domain_id = domain_id_of(settings, environment)
        self.overruns = 0
        """Number of times that a reader was full; some messages may then be uncounted."""
        self.faults = 0
        """Number of messages and announcements from others that could not be read."""
        self.unsent = 0
        """Number of ROS 2 messages that could not be sent."""
        self._gid_bytes = settings.gid_bytes
        self.inbox = Inbox(
            time.monotonic_ns, closed=() if settings.accept_pulses else ("pulse",)
        )
        """Received ROS 2 messages that wait for the gateway."""
        self._in_order: SendingOrder[tuple[RosTopic, Sample]] = SendingOrder(
            lambda one: (one[1].sample_info.source_timestamp, ORDER_OF_USE.get(one[0].name, 2))
        )
        self._senders = Senders()
        self._warnings: DdsWarnings | None = None
        self._closing = threading.Event()
        try:
            self._open(settings, environment, nodes)
        except DDSException as error:
            raise LinkError(
                f"cannot join the ROS 2 network: {error}",
                remedy="Check [ros2] interfaces, CYCLONEDDS_URI and the loopback interface",
            ) from error
        self._thread = threading.Thread(target=self._read, name="ros2-reader", daemon=True)
        self._thread.start()

    def _open(
        self, settings: Ros2Settings, environment: Mapping[str, str], nodes: Collection[str]
    ) -> None:
        if not environment.get("CYCLONEDDS_URI"):
            self._warnings = DdsWarnings()
            config = cyclone_config(
                settings.interfaces, reach_of(environment), self._warnings.path
            )
            try:
                self._domain = Domain(self.domain_id, config)
            finally:
                self._warnings.opened()
        mark = GATEWAY_MARK if TELEMETRY in nodes else DETECTOR_MARK
        self._participant = DomainParticipant(
            self.domain_id, qos=Qos(Policy.Userdata(b"enclave=/;" + mark))
        )
        self._publisher = Publisher(self._participant)
        self._subscriber = Subscriber(self._participant)
        self._topics: dict[str, Any] = {}
        self._writers: dict[tuple[str, str], Any] = {}
        self._readers: list[tuple[str, RosTopic, Any]] = []
        self._read_topics: dict[str, RosTopic] = {}
        """ROS 2 topics that this participant reads, by their DDS names."""
        self._waitset = WaitSet(self._participant)
        self._participants = BuiltinDataReader(self._participant, BuiltinTopicDcpsParticipant)
        self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._wake_for(self._participants)
        self._wake_for(self._publications)
        for topic in TOPICS.values():
            if topic.publisher in nodes:
                self._add_writer(topic.publisher, topic.name, topic.message, topic.depth)
            for node in nodes:
                if node in topic.subscribers:
                    self._add_reader(node, topic)
        for node in nodes:
            self._add_writer(node, LOG_TOPIC, LOG_MESSAGE, LOG_DEPTH, keep=True)
        if settings.parameter_services and PARAMETER_NODE in nodes:
            self._add_services()
        *_, info = messages.graph_messages(self._gid_bytes)
        self._info_writer = DataWriter(
            self._publisher,
            Topic(self._participant, DISCOVERY_TOPIC, dds_type(info)),
            # Without its hash, every program of ROS 2 prints a warning.
            qos=_writer_qos(depth=1, message=info, keep=True),
        )
        self._nodes = tuple(nodes)
        self._introduce(self._nodes)

    # ------------------------------------------------------------------ sending

    def publish(self, topic: str, message: RosMessage, node: str | None = None) -> None:
        """Send a message; `node`: its node, if several publish (``rosout``, ``pulse``)."""
        writer = self._writers.get((node or "", topic))
        self._write(writer or self._writers[TOPICS[topic].publisher, topic], message)

    def _write(self, writer: Any, message: RosMessage) -> None:
        kind = dds_type(type(message))
        sample = kind.__new__(kind)
        sample.cdr = encode(message)
        try:
            writer.write(sample)
        except DDSException:
            self.unsent += 1

    def reply(self, message: ServiceMessage) -> None:
        """Send the reply of a service."""
        self._write(self._writers[PARAMETER_NODE, _reply_name(type(message))], message)

    # ---------------------------------------------------------------- receiving

    def _read(self) -> None:
        """Read DDS messages until the participant is closed, in the only reading thread."""
        while not self._closing.is_set():
            try:
                if self._in_order or self._waitset.wait(duration(milliseconds=200)):
                    self._read_once()
                    time.sleep(READ_PAUSE_S)
                self._count_too_long()
            except Exception as error:  # noqa: BLE001 - a name that is not UTF-8, and the like
                self._note_fault(error)
                time.sleep(READ_PAUSE_S)

    def _read_once(self) -> None:
        """Take the messages of all readers, with those arriving meanwhile, in sending order.

        Without this order, the end of an upload could overtake some of its tags, and a start
        command the end.
        """
        for _ in range(PASSES):
            found = self._take_all()
            self._learn_senders()
            for topic, sample in self._in_order.add_pass(found):
                info = sample.sample_info
                self.inbox.put(
                    Arrival(
                        topic=topic,
                        cdr=sample.cdr,
                        sent_ns=info.source_timestamp,
                        sender=self._senders.of(info.publication_handle),
                    )
                )
            if not self._in_order:
                break

    def _count_too_long(self) -> None:
        """Count messages that the DDS library has dropped as too long."""
        for name in self._warnings.too_long() if self._warnings is not None else ():
            if name in self._read_topics:
                self.inbox.drop(self._read_topics[name])

    def _take_all(self) -> list[tuple[RosTopic, Sample]]:
        """Take all waiting messages, one reader after the other."""
        found: list[tuple[RosTopic, Sample]] = []
        for _, topic, reader in self._readers:
            samples = reader.take(READER_DEPTH)
            # Anything that is not a Sample means that a publisher has gone.
            found += [(topic, s) for s in samples if isinstance(s, Sample)]
            if len(samples) == READER_DEPTH:
                self.inbox.drop(topic)  # at least one was replaced
                self.overruns += 1
        return found

    def _learn_senders(self) -> None:
        """Register announced publishers; DDS announces a publisher before its messages."""
        for participant in self._announced(self._participants):
            data = _user_data(participant.qos)
            self._senders.add_participant(str(participant.key), data)
        for writer in self._announced(self._publications):
            handle, key = writer.sample_info.instance_handle, str(writer.participant_key)
            self._senders.add_writer(handle, key, writer.topic_name)

    def _announced(self, reader: Any) -> Iterator[Any]:
        """Yield announcements one by one: in a batch, one name that is not UTF-8 loses all."""
        for _ in range(ANNOUNCED_LIMIT):
            try:
                samples = reader.take(1)
            except Exception as error:  # noqa: BLE001 - a name that is not UTF-8, and the like
                self._note_fault(error)
                continue
            if not samples:
                return
            if samples[0].sample_info.valid_data:
                yield samples[0]

    def _note_fault(self, error: Exception) -> None:
        """Count an error that must not end the reading thread; log it at a limited rate."""
        self.faults += 1
        log.seldom(
            self.faults, "messages of the ROS 2 network cannot be read", error=repr(error)[:200]
        )

    def _wake_for(self, reader: Any) -> None:
        """Wake the reading thread when a reader has messages."""
        self._waitset.attach(
            ReadCondition(reader, SampleState.NotRead | ViewState.Any | InstanceState.Any)
        )

    # -------------------------------------------------------------------- nodes

    def _add_writer(
        self, node: str, name: str, message: type[RosMessage], depth: int, keep: bool = False
    ) -> None:
        qos = _writer_qos(depth=depth, message=message, keep=keep)
        topic = self._topic(name, message)
        self._writers[node, name] = DataWriter(self._publisher, topic, qos=qos)

    def _add_reader(
        self, node: str, topic: RosTopic, prefix: str = "rt", mark: str = ""
    ) -> None:
        policies = _qos(depth=READER_DEPTH, message=topic.message, mark=mark)
        # Skip our own endpoints.
        qos = Qos(*policies, Policy.IgnoreLocal.Process)
        shared = self._topic(topic.name, topic.message, prefix)
        reader = DataReader(self._subscriber, shared, qos=qos)
        self._wake_for(reader)
        self._readers.append((node, topic, reader))
        self._read_topics[shared.name] = topic

    def _add_services(self) -> None:
        """Create the request and reply topics of the parameter services."""
        for number, (service, (request, answer)) in enumerate(SERVICES.items()):
            bare = self._participant.guid.bytes[:15] + bytes([number])
            mark = f"serviceid={'.'.join(f'{byte:02x}' for byte in bare)};"
            name = f"{PARAMETER_NODE}/{service}"
            row = RosTopic(
                f"{name}Request",
                request,
                "",
                service,
                subscribers=(PARAMETER_NODE,),
                burst=SERVICE_BURST,
                per_s=SERVICE_PER_S,
            )
            self._add_reader(PARAMETER_NODE, row, prefix="rq", mark=mark)
            topic = self._topic(f"{name}Reply", answer, prefix="rr")
            qos = _writer_qos(depth=SERVICE_DEPTH, message=answer, mark=mark)
            writer = DataWriter(self._publisher, topic, qos=qos)
            self._writers[PARAMETER_NODE, _reply_name(answer)] = writer

    def _topic(self, name: str, message: type[RosMessage], prefix: str = "rt") -> Any:
        if name not in self._topics:
            # The log is shared by all namespaces, as in ROS 2.
            inside = f"{self._namespace}/" if self._namespace and name != LOG_TOPIC else ""
            self._topics[name] = Topic(
                self._participant, f"{prefix}/{inside}{name}", dds_type(message)
            )
        return self._topics[name]

    def _introduce(self, nodes: Collection[str]) -> None:
        """Announce the drone's nodes and their endpoints to ROS 2."""
        gid, node_info, info = messages.graph_messages(self._gid_bytes)

        def gid_of(entity: Any) -> Any:
            return gid(data=entity.guid.bytes.ljust(self._gid_bytes, b"\0"))

        self._write(
            self._info_writer,
            info(
                gid=gid_of(self._participant),
                node_entities_info_seq=tuple(
                    node_info(
                        node_namespace=f"/{self._namespace}",
                        node_name=self._names.get(node, node),
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

    def show_detectors(self, nodes: Collection[str]) -> None:
        """Keep one publishing node for each given tag's detector; raises `LinkError`."""
        topic = TOPICS["pulse"]
        own = {n for n, name in self._writers if name == topic.name and n not in self._nodes}
        for node in own.difference(nodes):
            del self._writers[node, topic.name]
        try:
            for node in nodes:
                if node not in own:
                    self._add_writer(node, topic.name, topic.message, topic.depth)
        except DDSException as error:
            raise LinkError(
                f"cannot make a ROS 2 node for each tag: {error}",
                remedy="Set [ros2] node_per_tag = false",
            ) from error
        self._introduce((*self._nodes, *nodes))

    def close(self) -> None:
        """Announce that the nodes are gone, then leave; else they stay listed for 10 s."""
        self._closing.set()
        self._thread.join(2.0)
        self._introduce(())
        try:
            self._info_writer.wait_for_acks(duration(milliseconds=round(GOODBYE_S * 1e3)))
        except (DDSException, AttributeError):  # cyclonedds 11 fails so when the time is over
            self.unsent += 1
        del self._waitset, self._info_writer, self._participants, self._publications
        self._writers.clear()
        self._readers.clear()
        self._topics.clear()
        del self._publisher, self._subscriber, self._participant
        self.__dict__.pop("_domain", None)
        if self._warnings is not None:
            self._warnings.close()
