"""Definitions and type hashes against independent ones."""

from functools import cache
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from uavrt.link.ros2 import graph
from uavrt.link.ros2.types import ros_messages as messages
from uavrt.link.ros2.types.interface import (
    definition,
    full_definition,
    full_name,
    nested_messages,
    type_hash,
)
from uavrt.link.ros2.types.ros_messages import RosMessage

PACKAGE = Path(__file__).parents[3] / "ros" / "uavrt_interfaces"
DISTRIBUTIONS = (Stores.ROS2_HUMBLE, Stores.ROS2_IRON, Stores.ROS2_JAZZY, Stores.ROS2_KILTED)


USED: list[type[RosMessage]] = [
    *dict.fromkeys(topic.message for topic in graph.TOPICS.values()),
    graph.LOG_MESSAGE,
]
OURS = [
    message
    for message in dict.fromkeys(each for one in USED for each in (*nested_messages(one), one))
    if message.ros_name.startswith("uavrt_interfaces/")
]


@cache
def with_ours(store: Stores) -> Typestore:
    types = get_typestore(store)
    for path in sorted((PACKAGE / "msg").glob("*.msg")):
        name = f"uavrt_interfaces/msg/{path.stem}"
        types.register(get_types_from_msg(path.read_text(encoding="utf-8"), name))
    return types


@pytest.mark.parametrize("message", OURS)
def test_the_ament_package_defines_our_messages_field_for_field(
    message: type[RosMessage],
) -> None:
    text = (PACKAGE / "msg" / f"{message.ros_name.split('/')[1]}.msg").read_text("utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    ours = definition(message).replace("uavrt_interfaces/", "").splitlines()
    assert lines == ours


def test_the_ament_package_has_our_messages_and_no_others() -> None:
    assert {path.stem for path in (PACKAGE / "msg").glob("*.msg")} == {
        message.ros_name.split("/")[1] for message in OURS
    }


@pytest.mark.parametrize("distribution", DISTRIBUTIONS, ids=lambda store: store.value)
@pytest.mark.parametrize("message", USED, ids=full_name)
def test_a_type_has_the_hash_that_ros_2_computes(
    message: type[RosMessage], distribution: Stores
) -> None:
    assert type_hash(message) == with_ours(distribution).hash_rihs01(full_name(message))


def test_the_hash_of_the_node_list_is_that_of_ros_2_jazzy() -> None:
    # Shown by `ros2 topic info -v ros_discovery_info` of ROS 2 Jazzy; rosbags errs on `char`.
    assert type_hash(messages.graph_messages(16)[2]) == (
        "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e"
    )


@pytest.mark.parametrize("message", USED, ids=full_name)
def test_the_full_definition_stands_alone(message: type[RosMessage]) -> None:
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(full_definition(message), full_name(message)))
    assert types.hash_rihs01(full_name(message)) == type_hash(message)


def test_every_topic_has_nodes_that_exist() -> None:
    for topic in graph.TOPICS.values():
        assert {topic.publisher, *topic.subscribers} <= set(graph.NODES)


def test_every_component_has_its_control_and_status_topics() -> None:
    for component, node in graph.COMPONENTS.items():
        assert graph.TOPICS[f"control_{component}_subprocess"].subscribers == (node,)
        assert graph.TOPICS[f"status_{component}_subprocess"].publisher == node


def test_the_graph_is_that_of_the_thesis() -> None:
    # Fig. 2.1 of the thesis, as topics between nodes.
    edges = {
        (topic.publisher.removesuffix("Component"), name, subscriber.removesuffix("Component"))
        for name, topic in graph.TOPICS.items()
        for subscriber in topic.subscribers
        if name not in graph.OWN_TOPICS
    }
    assert edges == {
        ("Detector", "pulse", "Telemetry"),
        ("Telemetry", "pulse_pose", "Command"),
        ("Command", "control_start_subprocess", "StartStop"),
        ("Command", "control_stop_subprocess", "StartStop"),
        ("Command", "store_tag_information", "StartStop"),
        ("Command", "release_tag_information", "StartStop"),
        ("StartStop", "control_airspy_csdr_netcat_subprocess", "AirspyCSDRNetcat"),
        ("StartStop", "control_channelizer_subprocess", "Channelizer"),
        ("StartStop", "control_detector_subprocess", "Detector"),
    }
