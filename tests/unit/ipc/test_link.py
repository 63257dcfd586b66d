import socket

import pytest

from uavrt.core.messages import StatusText
from uavrt.drone.ipc.record_link import RecordSocket, SupervisorGone
from uavrt.drone.ipc.topics import decode_record, encode_record


def text(number: int) -> StatusText:
    return StatusText(severity=6, text=f"text {number} " + "x" * 1000)


def test_what_the_socket_does_not_take_goes_out_later() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        link = RecordSocket(ours)
        for number in range(2000):
            link.send("status_text", text(number))
        got = b""
        theirs.settimeout(0.2)
        while got.count(b"\n") < 2000:
            got += theirs.recv(1 << 20)
            link.flush()
        numbers = [decode_record(line)[1] for line in got.splitlines()]
        assert numbers == [text(number) for number in range(2000)]


def test_records_are_received_in_order_and_garbage_is_counted() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        link = RecordSocket(ours)
        theirs.sendall(
            encode_record("status_text", text(1))
            + b"garbage\n"
            + encode_record("status_text", text(2))
        )
        assert link.receive(timeout_s=1.0) == [
            ("status_text", text(1)),
            ("status_text", text(2)),
        ]
        assert link.refused == 1


def test_a_child_whose_supervisor_has_gone_is_told() -> None:
    ours, theirs = socket.socketpair()
    with ours:
        link = RecordSocket(ours)
        theirs.close()
        with pytest.raises(SupervisorGone):
            link.receive()


def test_what_a_supervisor_sent_before_it_was_killed_is_received_first() -> None:
    ours, theirs = socket.socketpair()
    with ours:
        link = RecordSocket(ours)
        theirs.sendall(encode_record("status_text", text(1)) + b"half a li")
        theirs.close()
        assert link.receive(timeout_s=1.0) == [("status_text", text(1))]
        assert link.lines == 1
        with pytest.raises(SupervisorGone):
            link.receive(timeout_s=1.0)
