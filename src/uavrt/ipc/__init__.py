"""How the processes talk: records as JSON lines, samples as datagrams.

Each child has one stream socket to the supervisor, which passes records on by the table of
topics; nothing is shared that a kill could corrupt. Samples take their own road: one pair of
Unix datagram sockets from the receiver to each detector (`uavrt.ipc.samples`, which alone
needs NumPy).
"""

from uavrt.ipc.assignment import Assignment
from uavrt.ipc.link import ChildLink
from uavrt.ipc.process import ProcessFrame
from uavrt.ipc.topics import TOPICS, Topic, decode_record, encode_record

__all__ = [
    "TOPICS",
    "Assignment",
    "ChildLink",
    "ProcessFrame",
    "Topic",
    "decode_record",
    "encode_record",
]
