"""The real gateway process under settings and surroundings that are not the usual ones."""

from typing import Any

from uavrt.config.settings import Ros2Settings

INFO = "rmw_dds_common/msg/ParticipantEntitiesInfo"


def test_the_domain_comes_from_the_environment(
    launch: Any, ros_peer: Any, ros_domain: int, wait_until: Any
) -> None:
    launch(Ros2Settings(enabled=True), ROS_DOMAIN_ID=str(ros_domain))
    wait_until(lambda: "rt/pulse" in ros_peer.endpoints())


def test_a_site_s_own_configuration_of_cyclone_is_honoured(
    launch: Any, ros_domain: int, tmp_path: Any, wait_until: Any
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
    wait_until(lambda: trace.exists() and trace.stat().st_size > 0)


def test_a_domain_that_is_none_keeps_the_gateway_off_and_says_why(launch: Any) -> None:
    gateway = launch(Ros2Settings(enabled=True), ROS_DOMAIN_ID="field")
    (health,) = gateway.receive("health")
    assert not health.ok
    assert "ROS_DOMAIN_ID" in health.status
    assert gateway.close() == 0


def test_an_interface_that_is_not_there_keeps_the_gateway_off_and_says_why(
    launch: Any, ros_domain: int
) -> None:
    gateway = launch(Ros2Settings(enabled=True, domain_id=ros_domain, interfaces=("nosuch0",)))
    (health,) = gateway.receive("health")
    assert not health.ok
    assert "[ros2] interfaces" in health.status
    assert gateway.close() == 0


def test_without_the_extra_the_gateway_stays_off_and_says_so(
    launch: Any, tmp_path: Any
) -> None:
    (tmp_path / "cyclonedds.py").write_text("raise ImportError('no wheel for this computer')")
    gateway = launch(PYTHONPATH=str(tmp_path))
    (health,) = gateway.receive("health")
    assert not health.ok
    assert "uavrt[ros2] is not installed" in health.status
    assert gateway.close() == 0


def test_humble_and_galactic_get_their_longer_identifiers(
    launch: Any, ros_peer: Any, ros_domain: int, wait_until: Any
) -> None:
    from rosbags.typesys import get_types_from_msg

    text = "char[24] data"
    del ros_peer.types.fielddefs["rmw_dds_common/msg/Gid"]
    ros_peer.types.types.pop("rmw_dds_common/msg/Gid")
    ros_peer.types.register(get_types_from_msg(text, "rmw_dds_common/msg/Gid"))
    read = ros_peer.listen("ros_discovery_info", INFO, prefix="", keep=True)
    launch(Ros2Settings(enabled=True, domain_id=ros_domain, gid_bytes=24))
    infos: list[Any] = []

    def come() -> bool:
        infos.extend(ros_peer.read(cdr, INFO) for cdr in read())
        return bool(infos)

    wait_until(come)
    info = infos[-1]
    assert len(info.node_entities_info_seq) == 6
    assert len(info.gid.data) == 24
