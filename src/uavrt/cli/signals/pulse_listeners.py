"""Receivers of detection results in addition to the pulse file: plots, other programs."""

import os
import re
import socket
from collections.abc import Sequence
from pathlib import Path

from uavrt.cli.shown.notices import notice
from uavrt.config.settings import Ros2Settings, is_ros_namespace
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import UsageError, needs_extra
from uavrt.core.messages import ChannelBlock, Pulse, SearchReport, Tag
from uavrt.drone.ipc.pulse_datagram import PulseDatagramSender
from uavrt.link.ros2.graph import DETECTOR
from uavrt.link.ros2.ros_records import heartbeat, pulse_to_ros
from uavrt.radio.udp_address import parse_udp_address

HEARTBEAT_S = 1.0


class Listener:
    """Base class for receivers of detection results; its methods do nothing."""

    def channel(self, block: ChannelBlock) -> None:
        """Receive a block of a channel's samples."""

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Receive detected pulses."""

    def reports(self, reports: Sequence[SearchReport]) -> None:
        """Receive reports of searches without a pulse, at least twice a second."""

    def finish(self) -> None:
        """End the reception; this is called at the end, even after an error of the source."""


class PulseDatagrams(Listener):
    """Sends pulses as datagrams to the original system's controller."""

    def __init__(self, address: str, tags: Sequence[Tag]) -> None:
        host, port = parse_udp_address(address)
        self._sender = PulseDatagramSender(host, port, [tag.tag_id for tag in tags])

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Send pulses as datagrams."""
        self._sender.send_pulses(pulses)

    def reports(self, reports: Sequence[SearchReport]) -> None:
        """Send the search reports as datagrams, and a heartbeat of each detector."""
        self._sender.send_reports(reports)
        self._sender.heartbeat(monotonic_s())

    def close(self) -> None:
        """Close the socket for datagrams."""
        self._sender.close()


def remote_node_name() -> str:
    """Unique name of this detector on the network: ``Detector_fieldlaptop_4711``."""
    host = re.sub(r"[^A-Za-z0-9]+", "_", socket.gethostname()).strip("_")
    return f"Detector_{host[:60]}_{os.getpid()}"


class RosPulses(Listener):
    """Publishes pulses on ROS 2 as a detector node.

    `interfaces`: network interfaces separated by commas; ``lo``: this computer only.
    `tags`: each gets a heartbeat once a second while samples arrive.
    `namespace`: namespace of the drone that accepts the pulses.
    """

    def __init__(self, interfaces: str, tags: Sequence[Tag], namespace: str = "") -> None:
        with needs_extra("ros2", "ROS 2"):
            from uavrt.link.ros2.network.dds import Participant
        named = tuple(name for name in interfaces.split(",") if name not in ("", "lo"))
        if not is_ros_namespace(namespace):
            raise UsageError(
                f"{namespace!r} is not a ROS namespace",
                remedy="Give letters, digits and single underscores, like drone1",
            )
        settings = Ros2Settings(enabled=True, interfaces=named, namespace=namespace)
        self._participant = Participant(
            settings, nodes=(DETECTOR,), names={DETECTOR: remote_node_name()}
        )
        self._tags = tags
        self._clock = Clock.start()
        self._next_beat_s = 0.0

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Publish pulses on ROS 2."""
        for pulse in pulses:
            self._participant.publish("pulse", pulse_to_ros(pulse, ""))

    def reports(self, reports: Sequence[SearchReport]) -> None:
        """Publish a heartbeat per tag, once a second."""
        if monotonic_s() >= self._next_beat_s:
            self._next_beat_s = monotonic_s() + HEARTBEAT_S
            for tag in self._tags:
                beat = heartbeat(tag.tag_id, self._clock.now_ns(), "")
                self._participant.publish("pulse", beat)

    def close(self) -> None:
        """Leave the ROS 2 network."""
        self._participant.close()


class Plots(Listener):
    """Draws plots of the pulses and waterfalls at the end."""

    def __init__(
        self, directory: Path, tags: Sequence[Tag], frequency_window_hz: float
    ) -> None:
        from uavrt.analysis.report.plots import DetectionPlots

        self._plots: DetectionPlots = DetectionPlots(
            directory, tags, frequency_window_hz=frequency_window_hz
        )

    def channel(self, block: ChannelBlock) -> None:
        """Add a block of samples to the waterfalls."""
        self._plots.add_block(block)

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Store pulses, to draw them at the end."""
        self._plots.add_pulses(pulses)

    def finish(self) -> None:
        """Write the plots to files."""
        for path in self._plots.write():
            notice(path)
