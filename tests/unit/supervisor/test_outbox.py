import socket

import made
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import FlightInfo, PulsePose, StatusText
from uavrt.drone.ipc.topics import TOPICS, decode_record, encode_record
from uavrt.drone.supervisor.tree.table import PROCESSES
from uavrt.drone.supervisor.tree.waiting_records import MOST_KEPT, RUNS_WITHOUT_PROGRESS, Outbox


def status(number: int) -> bytes:
    return encode_record("status_text", StatusText(severity=6, text=str(number)))


def pulse(number: int) -> bytes:
    record = made.pulse(
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
def test_pulses_are_kept_and_old_texts_are_dropped_and_counted(pulses: int, texts: int) -> None:
    outbox = Outbox()
    for number in range(max(pulses, texts)):
        if number < pulses:
            outbox.put(pulse(number))
        if number < texts:
            outbox.put(status(number))
    lines = drain(outbox)
    kept = TOPICS["status_text"].newest or 0
    assert [line for line in lines if line.startswith(b"pulse")] == [
        pulse(number) for number in range(pulses)
    ]
    assert [line for line in lines if line.startswith(b"status")] == [
        status(number) for number in range(max(0, texts - kept), texts)
    ]
    assert outbox.dropped["status_text"] == max(0, texts - kept)


@given(st.integers(0, 300), st.integers(1, 50))
def test_an_onlooker_that_is_away_is_kept_the_newest_pulses_only(
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


def begun(number: int) -> bytes:
    return encode_record("flight", flight(number))


def flight(number: int) -> FlightInfo:
    return made.flight_info(str(number), start_time_ns=number)


@given(
    st.lists(st.tuples(st.sampled_from(["put", "take", "die"]), st.integers(0, 5)), max_size=60)
)
def test_every_line_is_taken_once_and_in_order(events: list[tuple[str, int]]) -> None:
    outbox = Outbox(keeps=True)
    put = 0
    taken: list[bytes] = []
    held: list[bytes] = []
    taken_now = 0
    for event, count in events:
        if event == "put":
            for _ in range(count):
                outbox.put(pulse(put))
                put += 1
            held += drain(outbox)
        elif event == "take":
            taken += held[:count]
            taken_now += len(held[:count])
            del held[:count]
            outbox.remove_acknowledged(taken_now)
        else:
            outbox.process_ended(by_itself=False)
            taken_now, held = 0, drain(outbox)
    assert taken + held == [pulse(number) for number in range(put)]
    assert outbox.holds("pulse_pose") == bool(held)


def test_a_successor_is_told_of_the_flight_that_its_first_records_belong_to() -> None:
    outbox = Outbox(keeps=True)
    lines = [begun(1), pulse(1), encode_record("flight_end", flight(1)), begun(2), pulse(2)]
    for line in lines:
        outbox.put(line)
    drain(outbox)
    expected = [None, flight(1), flight(1), None, flight(2), flight(2)]
    for count, info in enumerate(expected):
        outbox.remove_acknowledged(count)
        assert outbox.flight == info
    outbox.process_ended(by_itself=False)
    assert outbox.flight == flight(2)


def test_a_line_that_ends_every_process_that_gets_it_is_given_up_and_counted() -> None:
    outbox = Outbox(keeps=True)
    outbox.put(pulse(1))
    for life in range(RUNS_WITHOUT_PROGRESS):
        assert drain(outbox) == [pulse(1)], life
        outbox.process_ended(by_itself=True)
    assert drain(outbox) == []
    assert outbox.dropped["pulse_pose"] == 1


def test_a_process_that_others_kill_gets_its_lines_however_often() -> None:
    outbox = Outbox(keeps=True)
    outbox.put(pulse(1))
    for _ in range(3 * RUNS_WITHOUT_PROGRESS):
        assert drain(outbox) == [pulse(1)]
        outbox.process_ended(by_itself=False)


def test_what_is_kept_for_a_disk_that_fails_for_hours_is_bounded_and_counted() -> None:
    outbox = Outbox(keeps=True)
    for number in range(MOST_KEPT + 10):
        outbox.put(pulse(number))
    drain(outbox)
    assert outbox.dropped["pulse_pose"] == 10
    outbox.remove_acknowledged(11)  # the process counts those that are not kept any more, too
    outbox.process_ended(by_itself=False)
    assert drain(outbox)[0] == pulse(11)


def test_who_consumes_pulses_gets_those_that_a_hundred_tags_bring_at_once() -> None:
    """The groups of three of all tags may end in one turn of the supervisor."""
    consumers = [row for row in PROCESSES if {"pulse", "pulse_pose"} & {*row.consumes}]
    assert {row.name for row in consumers} >= {"recorder", "connection", "guide", "ros2"}
    for row in consumers:
        outbox = Outbox(row.backlog)
        for number in range(300):
            outbox.put(pulse(number))
        assert len(outbox) == 300, row.name
