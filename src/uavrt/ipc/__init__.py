"""How the processes talk: records as JSON lines, samples as datagrams.

Each child has one stream socket to the supervisor, which routes records by the table of
topics; processes share nothing that a kill could corrupt. Samples bypass the supervisor: one
pair of Unix datagram sockets from the receiver to each detector (`uavrt.ipc.samples`, the only
module here that needs NumPy).
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.ipc.assignment import Assignment
    from uavrt.ipc.link import LINK_VARIABLE, ChildLink, LineBuffer, SupervisorGone
    from uavrt.ipc.parent import (
        PARENT_VARIABLE,
        adopt_orphans,
        adopts_orphans,
        die_with_parent,
    )
    from uavrt.ipc.process import ProcessFrame
    from uavrt.ipc.pulse_datagram import PulseDatagramSender
    from uavrt.ipc.sample_sockets import make_sample_sockets
    from uavrt.ipc.samples import ChannelReceiver, ChannelSender
    from uavrt.ipc.topics import TOPICS, Topic, decode_record, encode_record, topic_of

__all__ = [
    "LINK_VARIABLE",
    "PARENT_VARIABLE",
    "TOPICS",
    "Assignment",
    "ChannelReceiver",
    "ChannelSender",
    "ChildLink",
    "LineBuffer",
    "ProcessFrame",
    "PulseDatagramSender",
    "SupervisorGone",
    "Topic",
    "adopt_orphans",
    "adopts_orphans",
    "decode_record",
    "die_with_parent",
    "encode_record",
    "make_sample_sockets",
    "topic_of",
]
__getattr__ = lazily(
    __name__,
    {
        "Assignment": "assignment",
        "ChannelReceiver": "samples",
        "ChannelSender": "samples",
        "ChildLink": "link",
        "LINK_VARIABLE": "link",
        "LineBuffer": "link",
        "PARENT_VARIABLE": "parent",
        "ProcessFrame": "process",
        "PulseDatagramSender": "pulse_datagram",
        "SupervisorGone": "link",
        "TOPICS": "topics",
        "Topic": "topics",
        "adopt_orphans": "parent",
        "adopts_orphans": "parent",
        "decode_record": "topics",
        "die_with_parent": "parent",
        "encode_record": "topics",
        "make_sample_sockets": "sample_sockets",
        "topic_of": "topics",
    },
)
