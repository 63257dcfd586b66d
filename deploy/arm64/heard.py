"""Messages that come over ROS 2: does this machine hear the emulated one?

By another release of the DDS library than there (`deploy/dds-wheel.sh`), as a workstation has.
"""

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.network.dds import cyclone_config, dds_type

TOPIC = "pulse"
DOMAIN = 64
# The emulator has no multicast (IP_MULTICAST_IF, ip(7)).
THERE = """\
<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast><Interfaces>
<NetworkInterface address="127.0.0.1"/></Interfaces></General><Discovery>
<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="localhost"/></Peers></Discovery></Domain></CycloneDDS>"""
SPEAK = f"""\
import importlib.metadata, time
from uavrt.config.settings import Ros2Settings
from uavrt.link.ros2.ros_records import heartbeat
from uavrt.link.ros2.network.dds import Participant

print("cyclonedds", importlib.metadata.version("cyclonedds"), flush=True)
ours = Participant(Ros2Settings(domain_id={DOMAIN}))
while True:
    ours.publish("{TOPIC}", heartbeat(2, time.time_ns(), ""))
    time.sleep(0.2)
"""


class Heard:
    """Subscribes as a node on this machine does."""

    def __init__(self) -> None:
        self._domain = Domain(DOMAIN, cyclone_config(()))
        self._participant = DomainParticipant(DOMAIN, Qos(Policy.Userdata(b"enclave=/;")))
        topic = Topic(self._participant, f"rt/{TOPIC}", dds_type(TOPICS[TOPIC].message))
        qos = Qos(
            Policy.Reliability.Reliable(duration(seconds=1)),
            Policy.History.KeepLast(1000),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        self._reader = DataReader(self._participant, topic, qos=qos)

    def count(self) -> int:
        """Count the messages that have come since it was asked last."""
        return sum(hasattr(sample, "cdr") for sample in self._reader.take(1000))
