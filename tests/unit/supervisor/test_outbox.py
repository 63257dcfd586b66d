import socket

from hypothesis import given
from hypothesis import strategies as st
from pulses import pulse_at

from uavrt.ipc import TOPICS, decode_record, encode_record
from uavrt.messages import PulsePose, StatusText
from uavrt.supervisor.outbox import Outbox


def status(number: int) -> bytes:
    return encode_record("status_text", StatusText(severity=6, text=str(number)))


def pulse(number: int) -> bytes:
    record = pulse_at(
        number,
        end_time_ns=number + 1,
        group_sequence=number,
        noise_psd=1e-9,
        detection_status="detected",
        confirmed=False,
    )
    return encode_record("pulse_pose", PulsePose(pulse=record, pose=None))


def drain(outbox: Outbox) -> list[bytes]:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setblocking(False)
        theirs.settimeout(0.2)
        got = b""
        while not outbox.write_to(ours):
            got += theirs.recv(1 << 20)
        ours.close()
        while data := theirs.recv(1 << 20):
            got += data
        return got.splitlines(keepends=True)


@given(st.integers(0, 300), st.integers(0, 300))
def test_pulses_are_all_kept_and_old_texts_are_dropped_and_counted(
    pulses: int, texts: int
) -> None:
    outbox = Outbox()
    for number in range(max(pulses, texts)):
        if number < pulses:
            outbox.put(pulse(number))
        if number < texts:
            outbox.put(status(number))
    lines = drain(outbox)
    kept = TOPICS["status_text"].backlog
    assert [line for line in lines if line.startswith(b"pulse")] == [
        pulse(number) for number in range(pulses)
    ]
    assert [line for line in lines if line.startswith(b"status")] == [
        status(number) for number in range(max(0, texts - kept), texts)
    ]
    assert outbox.dropped["status_text"] == max(0, texts - kept)


@given(st.integers(0, 300), st.integers(1, 50))
def test_an_onlooker_that_is_away_is_kept_only_the_newest_pulses(
    pulses: int, kept: int
) -> None:
    outbox = Outbox(kept)
    for number in range(pulses):
        outbox.put(pulse(number))
    assert drain(outbox) == [pulse(number) for number in range(max(0, pulses - kept), pulses)]
    assert outbox.dropped["pulse_pose"] == max(0, pulses - kept)


def test_a_restarted_process_gets_its_assignment_first_and_half_a_line_again() -> None:
    outbox = Outbox()
    big = encode_record("status_text", StatusText(severity=6, text="x" * 5_000_000))
    outbox.put(big)
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    assert not outbox.write_to(ours)
    ours.close()
    theirs.close()
    outbox.put_first(status(1))
    assert drain(outbox) == [status(1), big]
    assert decode_record(big)[0] == "status_text"
