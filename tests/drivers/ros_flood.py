"""A ROS 2 program gone wild: publishes the same message on one topic, fast or huge.

``python ros_flood.py DOMAIN TOPIC RATE SECONDS BYTES``; prints a line when it begins and
how many messages it has sent when it has ended. Its participant is one of its own.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from command_line import launched
from ros_peer import RosPeer, kind_of
from some import some

STEP_S = 0.01


def message(peer: Any, type_name: str, size: int) -> bytes:
    """Make a valid message of about so many bytes."""
    zero = peer.new("builtin_interfaces/msg/Time", 0, 0)
    header = peer.new("std_msgs/msg/Header", zero, "")
    tag = peer.new(
        "uavrt_interfaces/msg/Tag", 2, 148.71e6, 20.0, 1254.0, 60.0, 10.0, 0.0, 3, 0.005
    )
    pulse = peer.new(
        "uavrt_interfaces/msg/Pulse", "", 2, 148.71, zero, zero, zero, zero,
        20.0, 2.5, 1, 20.0, True, True,
    )  # fmt: skip
    match type_name.rpartition("/")[2]:
        case "Pulse":
            whole = pulse
        case "Tag":
            whole = tag
        case "PulsePose":
            point = peer.new("geometry_msgs/msg/Point", 0.0, 0.0, 0.0)
            turned = peer.new("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
            pose = peer.new("geometry_msgs/msg/Pose", point, turned)
            whole = peer.new(type_name, pulse, pose)
        case "Bool":
            whole = peer.new(type_name, True)
        case "CodedTag":
            whole = peer.new(type_name, tag, peer.numbers([30.0] * max(3, size // 8)))
        case _:
            one = peer.new("diagnostic_msgs/msg/DiagnosticStatus", 0, "wild", "go", "", [])
            whole = peer.new(type_name, header, [one] * max(1, size // 36))
    return bytes(peer.types.serialize_cdr(whole, type_name))


def main(domain: str, topic: str, rate: str, seconds: str, size: str) -> None:
    """Publish until the time is over."""
    peer = RosPeer(int(domain))
    # All that it sends is delivered, so that every message can be accounted for.
    peer.advertise(topic, depth=100_000)
    cdr = message(peer, kind_of(topic), int(size))
    print("begun", flush=True)
    sent, begun_s = 0, time.monotonic()
    while (now_s := time.monotonic() - begun_s) < float(seconds):
        while sent <= now_s * float(rate):
            peer.publish_bytes(topic, cdr)
            sent += 1
        time.sleep(STEP_S)
    time.sleep(0.5)
    print(sent, flush=True)
    sys.stdin.read()
    peer.close()


@contextmanager
def flood(
    domain: int, topic: str, *, rate: float, seconds: float, size: int = 0
) -> Iterator[Any]:
    """Run it; the result is a function that waits for the end and gets the number sent."""
    arguments = [str(value) for value in (domain, topic, rate, seconds, size)]
    with launched(Path(__file__), *arguments, stdin=subprocess.PIPE) as process:
        output = some(process.stdout)
        assert output.readline() == "begun\n"
        try:
            yield lambda: int(output.readline())
        finally:
            process.kill()


if __name__ == "__main__":
    main(*sys.argv[1:])
