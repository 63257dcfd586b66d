"""The original's UDP pulse record, against bytes packed here by the layout's description."""

import dataclasses
import math
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager

import made
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from uavrt.core.errors import FormatError, LinkError
from uavrt.drone.ipc.pulse_datagram import (
    PulseDatagramSender,
    PulseRecord,
    record_of_pulse,
    record_of_search,
)

PULSE = made.pulse(
    1_700_205_419_250_000_000,
    frequency_hz=148_710_612.4,
    snr_db=14.25,
    group_snr_db=13.5,
    score=2.75,
    group_index=3,
    group_sequence=17,
    noise_psd=3.5e-11,
    predicted_next_start_ns=1_700_205_420_434_000_000,
    predicted_next_end_ns=1_700_205_420_594_000_000,
)
GOLDEN = struct.pack(
    "<dddddddddddd",
    2.0,
    148_710_612.0,
    1_700_205_419.25,
    1_700_205_420.434,
    14.25,
    2.75,
    17.0,
    3.0,
    13.5,
    2.0,
    1.0,
    3.5e-11,
)


@contextmanager
def listening() -> Iterator[tuple[PulseDatagramSender, socket.socket]]:
    """A sender of tags 2 and 4, and who listens to it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5.0)
        sender = PulseDatagramSender("127.0.0.1", listener.getsockname()[1], [2, 4])
        yield sender, listener
        sender.close()


def test_a_pulse_has_the_bytes_of_the_original() -> None:
    assert len(GOLDEN) == 96
    assert record_of_pulse(PULSE).encode() == GOLDEN


def test_a_search_in_vain_has_its_own_state() -> None:
    report = made.search_report(2, 1_700_205_419_500_000_000, noise_psd=2e-11)
    expected = (2.0, 148_710_000.0, 1_700_205_419.5, 0, 0, 0.5, 0, 0, 0, 3.0, 0, 2e-11)
    assert record_of_search(report).encode() == struct.pack("<12d", *expected)


@pytest.mark.parametrize(
    ("status", "state"), [("subthreshold", 0), ("detected", 1), ("confirmed", 2)]
)
def test_each_status_is_its_number(status: str, state: int) -> None:
    pulse = dataclasses.replace(PULSE, detection_status=status)  # type: ignore[arg-type]
    assert struct.unpack("<12d", record_of_pulse(pulse).encode())[9] == state


def test_a_pulse_without_a_prediction_predicts_nothing() -> None:
    pulse = dataclasses.replace(PULSE, predicted_next_start_ns=None)
    assert record_of_pulse(pulse).predict_next_start_s == 0.0


@given(st.binary(min_size=96, max_size=96))
def test_every_record_comes_back_as_it_was(payload: bytes) -> None:
    record = PulseRecord.decode(payload)
    # Not a number need not keep its bits.
    assume(not any(math.isnan(getattr(record, name)) for name in record.__slots__))
    assert record.encode() == payload


@given(st.binary(max_size=200).filter(lambda payload: len(payload) != 96))
def test_another_size_is_refused(payload: bytes) -> None:
    with pytest.raises(FormatError, match="96 bytes"):
        PulseRecord.decode(payload)


def test_pulses_and_a_heartbeat_a_second_reach_who_listens() -> None:
    with listening() as (sender, listener):
        for now_s in (100.0, 100.4, 100.9, 101.1):
            sender.heartbeat(now_s)
        sender.send_pulses([PULSE])
        received = [PulseRecord.decode(listener.recv(200)) for _ in range(5)]
    assert [record.frequency_hz == 0.0 for record in received] == [True] * 4 + [False]
    assert [record.tag_id for record in received[:4]] == [2, 4, 2, 4]
    assert received[0] == PulseRecord(tag_id=2)
    assert received[4].encode() == GOLDEN
    assert sender.sent == 5


def test_nothing_is_said_to_be_found_only_when_the_next_pulse_is_overdue() -> None:
    begin_ns, overdue_ns = PULSE.start_time_ns, (PULSE.predicted_next_end_ns or 0) + 10**9
    times_ns = (begin_ns - 10**10, begin_ns + 10**9, overdue_ns, overdue_ns + 10**7)
    set_back, between, _, missed = (round(time_ns / 1e9, 3) for time_ns in times_ns)
    of_tag = {
        tag_id: [
            made.search_report(tag_id, time_ns, noise_psd=1e-11, best_score=0.2)
            for time_ns in times_ns
        ]
        for tag_id in (2, 4)
    }
    with listening() as (sender, listener):
        sender.send_reports(of_tag[2][1:2])
        sender.send_pulses([PULSE])
        sender.send_reports(of_tag[2] + of_tag[4])
        received = [PulseRecord.decode(listener.recv(200)) for _ in range(sender.sent)]
    told = [(r.tag_id, r.detection_status, round(r.start_time_s, 3)) for r in received]
    assert told[:2] == [(2, 3, between), (2, 2, round(begin_ns / 1e9, 3))]
    assert told[2:4] == [(2, 3, set_back), (2, 3, missed)]
    assert [tag_id for tag_id, _, _ in told[4:]] == [4] * 4


def test_nobody_listening_disturbs_nobody() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
    sender = PulseDatagramSender("127.0.0.1", port, [])
    sender.send_pulses([PULSE] * 10)
    sender.close()
    assert sender.sent + sender.dropped == 10


def test_an_unknown_host_is_named() -> None:
    with pytest.raises(LinkError, match=r"no\.such\.host\.invalid"):
        PulseDatagramSender("no.such.host.invalid", 50_000, [])
