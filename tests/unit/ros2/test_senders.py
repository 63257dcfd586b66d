"""Who sent a message."""

import pytest

from uavrt.link.ros2.ros_senders import (
    DETECTOR_MARK,
    GATEWAY_MARK,
    REMEMBERED,
    UNKNOWN,
    Sender,
    Senders,
)

ORDER = "rt/control_start_subprocess"


@pytest.fixture
def senders() -> Senders:
    return Senders()


def test_a_gateway_is_known_by_its_mark(senders: Senders) -> None:
    senders.add_participant("a", b"enclave=/;" + GATEWAY_MARK)
    senders.add_writer(7, "a", ORDER)
    assert senders.of(7) == Sender(key="a", gateway=True)


@pytest.mark.parametrize("system", ["rt/pulse_pose", "rt/drone1/pulse_pose"])
def test_who_publishes_the_pulses_of_a_drone_is_a_gateway_without_a_mark(
    senders: Senders, system: str
) -> None:
    # An earlier release, the original's program, or a recording that is played.
    senders.add_participant("a", b"enclave=/;")
    senders.add_writer(7, "a", ORDER)
    senders.add_writer(8, "a", system)
    assert senders.of(7).gateway


@pytest.mark.parametrize("data", [b"enclave=/;", b"", b"enclave=/;" + DETECTOR_MARK])
def test_an_operator_and_a_detector_are_no_gateways(senders: Senders, data: bytes) -> None:
    senders.add_participant("a", data)
    senders.add_participant("b", GATEWAY_MARK)
    senders.add_writer(7, "a", ORDER)
    senders.add_writer(8, "b", "rt/pulse_pose")
    assert senders.of(7) == Sender(key="a")


def test_who_was_never_heard_of_is_unknown(senders: Senders) -> None:
    assert senders.of(7) == UNKNOWN


def test_a_participant_that_could_not_be_read_is_unknown(senders: Senders) -> None:
    senders.add_writer(7, "a", ORDER)
    assert senders.of(7) == UNKNOWN


def test_a_network_gone_wild_does_not_fill_the_memory(senders: Senders) -> None:
    for number in range(3 * REMEMBERED):
        senders.add_participant(str(number), GATEWAY_MARK)
        senders.add_writer(number, str(number), ORDER)
    assert senders.of(0) == UNKNOWN
    assert senders.of(3 * REMEMBERED - 1).gateway
    assert len(senders._writers) == REMEMBERED
