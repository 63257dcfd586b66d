import dataclasses
import math

import made
import pytest
from some import typed

from uavrt.core.commands import CommandId, Generation, SystemState
from uavrt.core.errors import TunnelError
from uavrt.core.messages import PulsePose
from uavrt.core.units import ns_from_s
from uavrt.link.tunnel.generations.codec import acked_command_of, decode, generation_of
from uavrt.link.tunnel.generations.g0 import PulseG0
from uavrt.link.tunnel.generations.g1 import AckG1, FieldsG1, Heartbeat, PulseG1, TagG1
from uavrt.link.tunnel.generations.g2 import BareG2, UploadG2
from uavrt.link.tunnel.generations.wire import command_name
from uavrt.link.tunnel.tunnel_records import (
    detector_heartbeat,
    has_place,
    heartbeat_to_wire,
    pulse_from_wire,
    pulse_to_wire,
    search_report_to_wire,
    tag_from_wire,
    tag_of_number,
    tag_to_wire,
)

TAG = made.tunnel_tag()
POSE = made.pose(10**18, 46.5, 7.5, altitude_amsl_m=900.0)


def changed(**fields: float) -> TagG1:

    return dataclasses.replace(TAG, **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "4 to 128 bytes"),
        (b"\x04\0\0", "4 to 128 bytes"),
        (bytes(129), "4 to 128 bytes"),
        (b"\x63\0\0\0", "unknown command 99"),
        (b"\x04\0\0\0" + bytes(43), "TAG has 47 bytes, not 48 or 88"),
        (
            b"\x05\0\0\0" + bytes(4),
            "START_DETECTION has 8 bytes, not 4 or 12 or 16 or 32 or 40",
        ),
    ],
)
def test_a_payload_of_another_length_is_refused(payload: bytes, reason: str) -> None:
    with pytest.raises(TunnelError, match=reason) as caught:
        decode(payload)
    assert caught.value.payload == payload


def test_the_command_of_a_bad_payload_is_known_for_its_refusal() -> None:
    assert acked_command_of(b"\x04\0\0\0\1") == CommandId.TAG
    assert acked_command_of(b"\x04") is None


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"tag_id": 0}, "id is 0"),
        ({"frequency_hz": 0}, "frequency is 0"),
        ({"pulse_width_ms": 0}, "pulse width is 0"),
        ({"interval1_ms": 0}, "pulse interval is 0"),
        ({"k": 0}, "K is 0"),
        ({"false_alarm_probability": 0.0}, "false alarm"),
        ({"false_alarm_probability": math.nan}, "false alarm"),
        ({"pulse_width_ms": 1254}, "width exceeds interval"),
    ],
)
def test_a_tag_that_no_detector_could_use_is_refused_with_the_reason(
    fields: dict[str, float], reason: str
) -> None:
    with pytest.raises(TunnelError, match=reason):
        tag_from_wire(changed(**fields))


def test_a_second_interval_makes_a_tag_of_two_rates() -> None:
    assert tag_from_wire(changed(interval2_ms=1600)).pulse_intervals_s == (1.254, 1.6)


def test_three_rates_do_not_fit_the_wire() -> None:
    tag = made.tag(2, 1.5e8, 1.0, 1.2, 1.4)
    with pytest.raises(TunnelError, match="one or two"):
        tag_to_wire(tag)


def test_a_value_too_large_for_its_field_is_a_tunnel_error() -> None:
    with pytest.raises(TunnelError, match="does not fit"):
        changed(frequency_hz=2**32).encode()


def test_a_start_with_a_margin_but_no_ratio_is_refused() -> None:
    start = FieldsG1(command=CommandId.START_DETECTION, numbers=(0, 0, 0, 0.9))
    with pytest.raises(TunnelError, match="cannot have 4 fields"):
        start.encode()


def test_a_long_reason_is_cut_between_characters_and_still_ends_with_nul() -> None:
    payload = AckG1(acked_command=4, result=0, message="µ" * 100).encode()
    assert payload[127] == 0
    ack = typed(AckG1, decode(payload))
    assert ack.message == "µ" * 57


def test_the_thesis_start_tells_its_generation_and_a_bare_upload_does_not() -> None:
    def generation(payload: bytes) -> Generation | None:
        return generation_of(decode(payload))

    assert generation(b"\x05\0\0\0") == "G0"
    assert generation(b"\x05\0\0\0" + bytes(8)) == "G1"
    assert generation(b"\x02\0\0\0") is None


def test_a_detector_heartbeat_is_a_pulse_at_frequency_zero() -> None:
    wire = typed(PulseG1, decode(detector_heartbeat(3, 1_700_000_000 * 10**9).encode()))
    assert (wire.tag_id, wire.frequency_hz) == (3, 0)
    assert pulse_from_wire(wire) is None


def test_nothing_found_comes_back_with_its_noise_and_score() -> None:
    report = made.search_report(3, 1_700_000_000 * 10**9, noise_psd=2e-13, best_score=0.7)
    wire = search_report_to_wire(report)
    assert (wire.detection_status, wire.snr_db, wire.group_index) == (3, 0.0, 0)
    assert pulse_from_wire(wire) == report


@pytest.mark.parametrize("share", [0.0, 0.437, 1.0])
def test_the_usable_share_and_the_weakest_pulse_come_with_nothing_found(share: float) -> None:
    report = dataclasses.replace(
        made.search_report(3, 1_700_000_000 * 10**9), usable_share=share, weakest_enr_db=8.5
    )
    wire = search_report_to_wire(report)
    received = typed(PulseG1, decode(wire.encode()))
    assert pulse_from_wire(received) == report


def test_a_known_tag_gives_a_received_pulse_its_width() -> None:
    tag = tag_from_wire(TAG)
    wire = search_report_to_wire(
        made.search_report(2, 10**18, frequency_hz=1.5e8, noise_psd=1.0, best_score=2.0)
    )

    found = pulse_from_wire(dataclasses.replace(wire, detection_status=1), tag)
    assert isinstance(found, PulsePose)
    assert found.pulse.end_time_ns - found.pulse.start_time_ns == 20_000_000
    assert found.pulse.predicted_next_start_ns is None
    assert found.pose is None


@pytest.mark.parametrize(("state", "number"), list(zip(SystemState, range(5), strict=True)))
def test_states_have_the_numbers_of_the_original(state: SystemState, number: int) -> None:
    wire = heartbeat_to_wire(state, None)
    assert (wire.system_id, wire.status, wire.state) == (1, number, state)
    assert math.isnan(wire.cpu_temperature_c)


def test_an_unknown_state_number_is_no_state() -> None:
    assert Heartbeat(system_id=1, status=9, cpu_temperature_c=0.0).state is None


def test_an_unknown_pulse_status_is_refused() -> None:

    wire = search_report_to_wire(
        made.search_report(2, 10**18, frequency_hz=1.5e8, noise_psd=1.0, best_score=2.0)
    )
    with pytest.raises(TunnelError, match="unknown detection status 9"):
        pulse_from_wire(dataclasses.replace(wire, detection_status=9))


@pytest.mark.parametrize("time_s", [9.5e9, 1e10, -1.0, math.nan, math.inf])
def test_a_pulse_whose_time_does_not_fit_64_bits_is_refused(time_s: float) -> None:
    good = typed(PulseG1, pulse_to_wire(PulsePose(pulse=made.pulse(10**18), pose=None)))
    assert pulse_from_wire(good) is not None
    for name in ("start_time_s", "predict_next_start_s"):
        with pytest.raises(TunnelError, match="invalid time"):
            pulse_from_wire(dataclasses.replace(good, **{name: time_s}))  # type: ignore[arg-type]


@pytest.mark.parametrize("number", [0, 10, 77, 2**32 - 1])
def test_an_unknown_command_number_has_a_name_and_fails_no_decoder(number: int) -> None:
    assert command_name(number) == f"command {number}"
    for size, kind in ((8, BareG2), (16, UploadG2)):
        payload = number.to_bytes(4, "little").ljust(size, b"\0")
        with pytest.raises(TunnelError, match=f"unknown command {number}"):
            kind.decode(payload)


TWO_RATES = dataclasses.replace(tag_from_wire(TAG), tag_id=4, pulse_intervals_s=(1.254, 1.881))


def sent_of_rate(rate: int, half_s: float, generation: Generation) -> PulsePose:
    """What the ground reads of a pulse whose detector expects the next within ± half_s."""
    interval_s = TWO_RATES.pulse_intervals_s[rate - 1]
    start_ns = 1_700_205_419_230_494_976
    sent = dataclasses.replace(
        made.pulse(start_ns),
        tag_id=4,
        rate=rate,
        predicted_next_start_ns=start_ns + ns_from_s(interval_s - half_s),
    )
    message = pulse_to_wire(PulsePose(pulse=sent, pose=None), generation)
    assert isinstance(message, PulseG0 | PulseG1)
    got = typed(PulsePose, pulse_from_wire(message, TWO_RATES))
    return got


@pytest.mark.parametrize("generation", ["G0", "G1"])
@pytest.mark.parametrize("half_s", [0.0005, 0.010, 0.070])
@pytest.mark.parametrize("rate", [1, 2])
def test_a_pulse_keeps_its_rate(rate: int, half_s: float, generation: Generation) -> None:
    assert sent_of_rate(rate, half_s, generation).pulse.rate == rate


@pytest.mark.parametrize("rate", [1, 2])
def test_rates_closer_than_their_uncertainty_are_told_by_a_narrow_prediction(rate: int) -> None:
    close = dataclasses.replace(TWO_RATES, pulse_intervals_s=(1.254, 1.333))
    start_s = 1_700_205_419.25
    wire = pulse_to_wire(PulsePose(pulse=made.pulse(ns_from_s(start_s)), pose=None))
    assert isinstance(wire, PulseG1)
    told = dataclasses.replace(
        wire,
        tag_id=4,
        start_time_s=start_s,
        predict_next_start_s=start_s + close.pulse_intervals_s[rate - 1] - 0.010,
    )
    got = typed(PulsePose, pulse_from_wire(told, close))
    assert got.pulse.rate == rate


def test_the_originals_second_detector_of_a_tag_is_its_second_rate() -> None:
    wire = pulse_to_wire(
        PulsePose(pulse=dataclasses.replace(made.pulse(10**18), tag_id=5), pose=None)
    )
    assert isinstance(wire, PulseG1)
    tags = {4: TWO_RATES}
    assert tag_of_number(5, tags) == TWO_RATES
    got = typed(PulsePose, pulse_from_wire(wire, tag_of_number(5, tags)))
    assert (got.pulse.tag_id, got.pulse.rate) == (4, 2)


def test_a_listed_number_after_a_tag_of_two_rates_is_itself() -> None:
    listed = dataclasses.replace(TWO_RATES, tag_id=5)
    assert tag_of_number(5, {4: TWO_RATES, 5: listed}) == listed
    one_rate = dataclasses.replace(TWO_RATES, pulse_intervals_s=(1.254,))
    assert tag_of_number(5, {4: one_rate}) is None


@pytest.mark.parametrize(
    ("field", "value"),
    [("latitude_deg", 90.5), ("latitude_deg", -1.4e306), ("longitude_deg", 465_000_000.0)],
)
def test_a_pulse_is_kept_without_a_place_off_the_globe(field: str, value: float) -> None:
    """Stored with it, the pulse's line would be refused by every reader."""
    wire = typed(PulseG1, pulse_to_wire(PulsePose(pulse=made.pulse(10**18), pose=POSE)))
    astray = dataclasses.replace(wire, **{field: value})  # type: ignore[arg-type]
    heard = typed(PulsePose, pulse_from_wire(astray, None))
    assert heard.pose is None
    assert has_place(astray)
    kept = typed(PulsePose, pulse_from_wire(wire, None))
    assert kept.pose is not None
