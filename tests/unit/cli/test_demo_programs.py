"""The surroundings of the demo's programs."""

import socket

import pytest

from uavrt.link.ros2.network.dds import reach_of
from uavrt.simulation.demo.demo_programs import demo_environment, free_ros_domain


def test_the_demo_s_ros_domain_is_nobody_s(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    domains = {free_ros_domain() for _ in range(300)}
    assert len(domains) > 50
    assert not domains & {0, 42}


def test_a_domain_that_somebody_uses_is_not_taken() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        taken = free_ros_domain()
        sock.bind(("127.0.0.1", 7400 + 250 * taken + 10))
        assert taken not in {free_ros_domain() for _ in range(300)}


def test_no_setting_of_the_site_takes_the_demo_off_the_loopback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "file:///etc/site.xml")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    environment = demo_environment()
    assert "CYCLONEDDS_URI" not in environment
    assert reach_of(environment) == "computer"
    assert environment["PATH"]
