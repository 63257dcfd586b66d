"""The real gateway process under settings and surroundings that are not the usual ones."""

from dataclasses import replace
from typing import Any

import made
import pytest
from until import until

from uavrt.config.loader import load_settings
from uavrt.config.settings import Ros2Settings, is_ros_namespace
from uavrt.core.errors import ConfigError
from uavrt.core.messages import StatusText
from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.types.interface import type_hash
from uavrt.link.ros2.types.ros_messages import graph_messages


def test_the_domain_comes_from_the_environment(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    launch(Ros2Settings(enabled=True), ROS_DOMAIN_ID=str(ros_domain))
    until(lambda: "rt/pulse" in ros_peer.endpoints())


def test_a_site_s_own_configuration_of_cyclone_is_honoured(
    launch: Any, ros_domain: int, tmp_path: Any
) -> None:
    trace = tmp_path / "cyclone.log"
    config = (
        "<CycloneDDS><Domain><General><Interfaces>"
        '<NetworkInterface address="127.0.0.1"/></Interfaces></General>'
        f"<Tracing><Verbosity>config</Verbosity><OutputFile>{trace}</OutputFile></Tracing>"
        "</Domain></CycloneDDS>"
    )
    gateway = launch(CYCLONEDDS_URI=config)
    gateway.receive("health")
    until(lambda: trace.exists() and trace.stat().st_size > 0)


@pytest.mark.parametrize(
    ("values", "environment", "named"),
    [
        ({}, {"ROS_DOMAIN_ID": "field"}, "ROS_DOMAIN_ID"),
        ({"interfaces": ("nosuch0",)}, {}, "[ros2] interfaces"),
        ({}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "FAR"}, "ROS_AUTOMATIC_DISCOVERY_RANGE"),
        ({}, {"PYTHONPATH": "without_cyclone"}, "uavrt[ros2] is not installed"),
    ],
)
def test_what_cannot_be_keeps_the_gateway_off_and_says_why(
    launch: Any, ros_domain: int, tmp_path: Any, values: Any, environment: Any, named: str
) -> None:
    (tmp_path / "cyclonedds.py").write_text("raise ImportError('no wheel for this computer')")
    if "PYTHONPATH" in environment:
        environment = {"PYTHONPATH": str(tmp_path)}
    domain_id = None if "ROS_DOMAIN_ID" in environment else ros_domain
    gateway = launch(Ros2Settings(enabled=True, domain_id=domain_id, **values), **environment)
    (health,) = gateway.receive("health")
    assert not health.ok
    assert named in health.status
    assert gateway.close() == 0


def test_humble_and_galactic_get_their_longer_identifiers(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    from rosbags.typesys import get_types_from_msg

    text = "char[24] data"
    del ros_peer.types.fielddefs["rmw_dds_common/msg/Gid"]
    ros_peer.types.types.pop("rmw_dds_common/msg/Gid")
    ros_peer.types.register(get_types_from_msg(text, "rmw_dds_common/msg/Gid"))
    infos = ros_peer.listen("ros_discovery_info")
    launch(Ros2Settings(enabled=True, domain_id=ros_domain, gid_bytes=24))
    info = infos.newest(lambda info: len(info.node_entities_info_seq) == 6)
    assert len(info.gid.data) == 24


def test_a_vehicle_in_a_namespace_has_all_but_the_log_in_it(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    infos = ros_peer.listen("ros_discovery_info")
    logs = ros_peer.listen("rosout")
    gateway = launch(Ros2Settings(enabled=True, domain_id=ros_domain, namespace="/fleet/a1"))
    expected = {f"rt/fleet/a1/{name}" for name in TOPICS} | {"rt/rosout", "ros_discovery_info"}
    until(lambda: set(ros_peer.endpoints()) >= expected)
    assert set(ros_peer.endpoints()) - expected == set()
    nodes = infos.newest().node_entities_info_seq
    assert {node.node_namespace for node in nodes} == {"/fleet/a1"}
    ros_peer.advertise("fleet/a1/release_tag_information")
    ros_peer.publish("fleet/a1/release_tag_information", ros_peer.release())
    (command,) = gateway.receive("command")
    assert command.name == "end_tags"
    gateway.send("status_text", StatusText(severity=3, text="radio absent"))
    line = logs.newest(lambda line: line.msg == "radio absent")
    assert line.name == "fleet.a1.StartStopComponent"


@pytest.mark.parametrize("text", ["", "drone1", "/drone1", "fleet/_a/b2", "a" * 100])
def test_what_ros_2_takes_for_a_namespace(text: str) -> None:
    assert is_ros_namespace(text)


@pytest.mark.parametrize(
    "text", ["1a", "a b", "a//b", "a/", "/", "a__b", "a-b", "ä", "a\n", "~", "a" * 101, "a/1"]
)
def test_what_ros_2_refuses_as_a_namespace(text: str) -> None:
    assert not is_ros_namespace(text)


def test_the_node_list_has_a_type_hash_so_that_ros_2_prints_no_warning(
    launch: Any, ros_peer: Any
) -> None:
    launch()
    until(lambda: "ros_discovery_info" in ros_peer.endpoints())
    policies = {p.__scope__: p for p in ros_peer.endpoints()["ros_discovery_info"].qos}
    expected = f"typehash={type_hash(graph_messages(16)[2])};"
    assert policies["Userdata"].data == expected.encode()


@pytest.mark.parametrize(
    "environment", [{"ROS_LOCALHOST_ONLY": "1"}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}]
)
def test_ros_2_s_own_variables_keep_us_on_this_computer(
    launch: Any, ros_peer: Any, ros_domain: int, environment: dict[str, str]
) -> None:
    # An interface that is not there would keep the gateway off; it is not asked for.
    settings = Ros2Settings(enabled=True, domain_id=ros_domain, interfaces=("nosuch0",))
    gateway = launch(settings, **environment)
    (health,) = gateway.receive("health")
    assert health.ok
    until(lambda: "rt/pulse" in ros_peer.endpoints())


def test_a_discovery_range_of_off_hides_us(launch: Any, ros_peer: Any) -> None:
    gateway = launch(ROS_AUTOMATIC_DISCOVERY_RANGE="OFF")
    assert all(health.ok for health in gateway.receive("health", 3))
    assert ros_peer.endpoints() == {}


def test_each_tag_may_have_a_detector_node_that_publishes_its_pulses(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    tags = tuple(made.tag(n, 148.7e6) for n in (2, 4))
    flight = made.flight_info("/flights/one", tags, start_time_ns=1)
    infos = ros_peer.listen("ros_discovery_info")
    settings = Ros2Settings(enabled=True, domain_id=ros_domain, node_per_tag=True)
    gateway = launch(settings, flight=flight)
    newest: dict[str, Any] = {}

    def nodes() -> set[str]:
        for newest["info"] in infos.messages():
            pass
        found = newest["info"].node_entities_info_seq if newest else ()
        newest.update({node.node_name: node for node in found})
        return {node.node_name for node in found if node.node_name.startswith("Detector_tag")}

    until(lambda: nodes() == {"Detector_tag_2", "Detector_tag_4"})
    (writer,) = newest["Detector_tag_4"].writer_gid_seq
    # What a node publishes comes from its own publisher.
    reader = ros_peer.reader("pulse")
    until(lambda: len(reader.get_matched_publications()) == 3)
    gateway.send("pulse", made.pulse(1_777_623_301_019_828_320, tag_id=4))
    samples: list[Any] = []

    def come() -> bool:
        samples.extend(s for s in reader.take(10) if hasattr(s, "cdr"))
        return bool(samples)

    until(come)
    handle = samples[0].sample_info.publication_handle
    assert reader.get_matched_publication_data(handle).key.bytes == bytes(writer.data)
    # The next flight has other tags, and so other nodes.
    gateway.send("flight_end", flight)
    gateway.send("flight", replace(flight, tags=tags[:1]))
    until(lambda: nodes() == {"Detector_tag_2"})


def test_a_namespace_in_the_file_is_refused_in_words(tmp_path: Any) -> None:
    file = tmp_path / "uavrt.toml"
    file.write_text('[ros2]\nnamespace = "drone 1"\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="letters, digits and single underscores"):
        load_settings(file)
