"""The gateway process: publishes the drone's data as ROS 2 topics and accepts commands.

Faults of the gateway or the network do not affect detection. The process has a limited queue
and a low priority, and is restarted like any other.
"""

import os
import time
from typing import TYPE_CHECKING

from uavrt.core.clock import monotonic_s
from uavrt.core.errors import ConfigError, LinkError
from uavrt.core.log import get_logger
from uavrt.core.messages import FlightInfo
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.link.ros2.gateway import Gateway

if TYPE_CHECKING:
    from uavrt.link.ros2.network.dds import Participant

log = get_logger()

TICK_S = 0.05
"""Longest time that a pulse waits in the gateway before it is sent to ROS 2 [s]."""
NICENESS = 10
"""Scheduling priority below that of the detectors (Unix niceness)."""
RETRY_S = 10.0


def main() -> None:
    """Pass records to the ROS 2 network, and commands back, until stopped."""
    os.nice(NICENESS)
    with ProcessFrame.start() as frame:
        participant = join(frame)
        if participant is None:
            return
        try:
            serve(frame, participant)
        finally:
            participant.close()


def join(frame: ProcessFrame) -> "Participant | None":
    """Join the ROS 2 network; repeat failed attempts, and report the reason."""
    reason_sent = ""
    while frame.running:
        try:
            # Imported here: without the extra, the gateway says so and stays off.
            from uavrt.link.ros2.network.dds import Participant

            return Participant(frame.assignment.settings.ros2)
        except ImportError as error:
            reason = f"off: uavrt[ros2] is not installed ({error})"
        except (ConfigError, LinkError) as error:
            reason = f"off: {error}"
        if reason != reason_sent:
            log.warning("ROS 2 gateway disabled", reason=reason)
        reason_sent = reason
        wait(frame, reason, RETRY_S)
    return None


def wait(frame: ProcessFrame, reason: str, seconds: float) -> None:
    """Receive records and send health reports for a given time."""
    end_s = monotonic_s() + seconds
    while frame.running and monotonic_s() < end_s:
        frame.receive(timeout_s=0.5)
        frame.report(reason, ok=False)


def serve(frame: ProcessFrame, participant: "Participant") -> None:
    """Publish records as ROS 2 topics; pass ROS 2 commands to the supervisor."""
    assignment = frame.assignment
    gateway = Gateway(
        participant,
        assignment.settings,
        frame.send,
        lambda: frame.clock.now_ns(),
        assignment.flight,
    )

    def counters() -> dict[str, float]:
        inbox = participant.inbox
        return gateway.counters | {
            "ros2_messages_of_gateways": inbox.of_gateways,
            "ros2_messages_dropped": sum(inbox.dropped.values()),
            "ros2_readers_full": participant.overruns,
            "ros2_messages_unsent": participant.unsent,
            "ros2_faults": participant.faults,
        }

    log.info("ROS 2 nodes started", domain=participant.domain_id)
    while frame.running:
        # Not woken by each record: with a hundred tags that would double the cost.
        time.sleep(TICK_S)
        for topic, record in frame.receive():
            if isinstance(record, FlightInfo):
                gateway.take_flight(record if topic == "flight" else None)
            else:
                gateway.receive(record)
        gateway.tick()
        frame.report(f"domain {participant.domain_id}", counters=counters)


if __name__ == "__main__":
    main()
