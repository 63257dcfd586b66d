"""Commands arrive although other topics are flooded: real gateway, real DDS, wild programs."""

import time
from collections.abc import Callable
from typing import Any

import pytest
from ros_flood import flood
from ros_peer import GatewayProcess
from until import until

from uavrt.config.settings import Ros2Settings
from uavrt.link.ros2.graph import TOPICS

ACT_WITHIN_S = 3.0
"""Grossly missed: the bar is 1 s on a quiet computer, and tests share theirs with others."""
COUNTED_WITHIN_S = 40.0
RATE = 10_000.0


def delays_of_orders(gateway: Any, ros_peer: Any, seconds: float) -> list[float]:
    """Times from the sending of each start and stop until the supervisor has it [s]."""
    delays = []
    end_s = time.monotonic() + seconds
    while True:
        for what, name in (("start", "start_detection"), ("stop", "stop_detection")):
            begun_s = time.monotonic()
            ros_peer.publish(f"control_{what}_subprocess", ros_peer.order(what))
            while all(command.name != name for command in gateway.receive("command")):
                pass
            delays.append(time.monotonic() - begun_s)
        if time.monotonic() > end_s:
            return delays
        time.sleep(1.0)


def counters_when(
    gateway: GatewayProcess, true: Callable[[dict[str, float]], bool]
) -> dict[str, float]:
    """Counters once they are as they should: DDS may still hold a part of a flood."""
    return until(lambda: told if true(told := gateway.counters()) else None, COUNTED_WITHIN_S)


@pytest.mark.parametrize(
    "topic", ["pulse", "store_tag_information", "control_detector_subprocess"]
)
def test_ten_thousand_messages_a_second_delay_no_order_and_are_counted(
    launch: Any, ros_peer: Any, ros_domain: int, topic: str
) -> None:
    gateway = launch(Ros2Settings(enabled=True, domain_id=ros_domain, accept_pulses=True))
    logs = ros_peer.listen("rosout")
    ros_peer.advertise("control_start_subprocess", "control_stop_subprocess")
    delays_of_orders(gateway, ros_peer, 0.0)  # they have found each other
    row = TOPICS[topic]
    with flood(ros_domain, topic, rate=RATE, seconds=3.0) as wait:
        delays = delays_of_orders(gateway, ros_peer, 2.0)
        sent = wait()
    assert max(delays) < ACT_WITHIN_S
    assert sent > 0.5 * 3.0 * RATE
    told = counters_when(
        gateway,
        lambda told: (
            bool(told["ros2_readers_full"])
            or sent - told["ros2_messages_dropped"] <= row.burst + 10.0 * row.per_s
        ),
    )
    assert told["ros2_messages_dropped"] <= sent
    lines = [line.msg for line in logs.messages()]
    assert any(line.startswith(f"{topic}: dropped messages: ") for line in lines)


@pytest.mark.parametrize("size", [200_000, 16_000_000])
@pytest.mark.parametrize(
    "topic", ["store_coded_tag_information", "control_detector_subprocess"]
)
def test_one_enormous_message_a_second_delays_no_order_and_is_counted(
    launch: Any, ros_peer: Any, ros_domain: int, topic: str, size: int
) -> None:
    gateway = launch()
    ros_peer.advertise("control_start_subprocess", "control_stop_subprocess")
    delays_of_orders(gateway, ros_peer, 0.0)
    with flood(ros_domain, topic, rate=1.0, seconds=2.5, size=size) as wait:
        delays = delays_of_orders(gateway, ros_peer, 2.0)
        sent = wait()
    assert max(delays) < ACT_WITHIN_S
    counters_when(gateway, lambda told: told["ros2_messages_dropped"] == sent)
