"""Properties of frames, time and pacing."""

import random
import struct
from itertools import pairwise

import made
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.core.clock import Clock
from uavrt.core.messages import TunnelPayload
from uavrt.link.mavlink.autopilot.timesync import TimeSync
from uavrt.link.mavlink.component import Component, Handlers
from uavrt.link.mavlink.dialect import MESSAGES, Ping, Statustext, Tunnel
from uavrt.link.mavlink.frame import FrameParser, FrameWriter, crc16_mcrf4xx
from uavrt.link.mavlink.sending.pacing import CAPACITY, PacedQueue, Priority
from uavrt.link.mavlink.sending.statustext import TextAssembler, chunks_of
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot

PAYLOADS = st.binary(max_size=128)
START_NS = 1_700_000_000 * 10**9


def tunnel_of(payload: bytes) -> Tunnel:
    return made.tunnel(
        0,
        payload.ljust(128, b"\0"),
        target_system=1,
        target_component=191,
        payload_length=len(payload),
    )


@given(st.binary(max_size=300))
def test_the_fast_checksum_is_the_bitwise_one(data: bytes) -> None:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    assert crc16_mcrf4xx(data) == crc


@given(st.lists(PAYLOADS, min_size=1, max_size=8), st.data())
def test_frames_survive_any_cutting_of_the_stream(
    payloads: list[bytes], data: st.DataObject
) -> None:
    writer = FrameWriter(255, 190)
    stream = b"".join(writer.encode(tunnel_of(payload)) for payload in payloads)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    parser = FrameParser()
    frames = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        frames += parser.feed(stream[start:end])
    assert [frame.message() for frame in frames] == [tunnel_of(p) for p in payloads]
    assert (parser.bad_crc, parser.skipped_bytes) == (0, 0)


@given(PAYLOADS, st.binary(max_size=40))
def test_rubbish_before_frames_costs_no_frame(payload: bytes, rubbish: bytes) -> None:
    parser = FrameParser()
    frame = FrameWriter(1, 191).encode(tunnel_of(payload))
    # A false marker in the rubbish may claim up to 280 bytes: enough frames follow to end it.
    found = parser.feed(rubbish + frame * 40)
    ours = [f for f in found if f.message() == tunnel_of(payload)]
    claimed = 0 if not set(rubbish) & {0xFD, 0xFE} else 2
    assert len(ours) >= 40 - claimed - 300 // len(frame)
    if not set(rubbish) & {0xFD, 0xFE}:
        assert len(ours) == 40


@settings(max_examples=250)
@given(st.binary(max_size=600))
def test_any_bytes_are_parsed_without_a_fault(data: bytes) -> None:
    parser = FrameParser()
    for frame in parser.feed(data):
        frame.message()
    whole = FrameWriter(1, 191).encode(tunnel_of(b"after it"))
    # A false marker may claim up to 280 bytes of what follows.
    after = parser.feed(bytes(300) + whole)
    assert after[-1].message() == tunnel_of(b"after it")
    assert parser.skipped_bytes >= 20


@settings(max_examples=150)
@given(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=255))
def test_any_payload_of_a_known_message_is_read_and_written_back(
    message_id: int, payload: bytes
) -> None:
    kind = MESSAGES[message_id]
    message = kind.decode(payload)
    assert len(message.pack()) == kind.LAYOUT.size
    if not any(isinstance(getattr(message, name), str) for name in message.__slots__):
        assert kind.decode(message.pack()).pack() == message.pack()


@given(PAYLOADS, st.integers(0, 7), st.data())
def test_a_flipped_bit_is_counted_and_never_believed(
    payload: bytes, bit: int, data: st.DataObject
) -> None:
    frame = bytearray(FrameWriter(1, 191).encode(tunnel_of(payload)))
    place = data.draw(st.integers(10, len(frame) - 1))
    frame[place] ^= 1 << bit
    parser = FrameParser()
    assert parser.feed(bytes(frame)) == []
    assert parser.bad_crc >= 1


@given(
    offset_s=st.floats(-1e6, 1e6),
    skew_ppm=st.floats(-200, 200),
    jitter_s=st.floats(0, 0.005),
    seed=st.integers(0, 999),
)
@settings(max_examples=25)
def test_boot_time_is_mapped_within_the_jitter_whatever_offset_and_skew(
    offset_s: float, skew_ppm: float, jitter_s: float, seed: int
) -> None:
    draw = random.Random(seed)
    sync = TimeSync()

    def boot_ns(local_ns: int) -> int:
        elapsed = local_ns - START_NS
        return round(offset_s * 1e9) + elapsed + round(elapsed * skew_ppm * 1e-6)

    sent_ns = START_NS
    for step in range(60):
        there, back = draw.uniform(0, jitter_s), draw.uniform(0, jitter_s)
        arrived_ns = sent_ns + round(there * 1e9)
        sync.add_round_trip(sent_ns, boot_ns(arrived_ns), arrived_ns + round(back * 1e9))
        for age_s in (0.0, 0.5):
            instant_ns = sent_ns - round(age_s * 1e9)
            local_ns = sync.local_ns(boot_ns(instant_ns))
            assert local_ns is not None
            # Half a round trip of one-sided delay and its lever; before the tilt is known,
            # 200 ppm over 6 s on top.
            bound_s = jitter_s + (0.0013 if sent_ns - START_NS < 8 * 10**9 else 0.0001)
            assert abs(local_ns - instant_ns) <= bound_s * 1e9
        sent_ns += 100_000_000 if step < 20 else 1_000_000_000
    assert sync.resets == 0


@given(st.lists(st.tuples(st.sampled_from(list(CAPACITY)), st.integers(0, 255)), max_size=60))
def test_messages_leave_by_priority_in_order_and_a_gap_apart(
    puts: list[tuple[Priority, int]],
) -> None:
    queue = PacedQueue(0.020)
    for priority, number in puts:
        queue.put(TunnelPayload(bytes([number])), priority)
    expected = [bytes([n]) for p in Priority for q, n in puts if q == p]
    taken, now_ns, last_ns = [], START_NS, None
    while (wait_ns := queue.wait_ns(now_ns)) is not None:
        now_ns += wait_ns
        item = queue.take(now_ns)
        assert isinstance(item, TunnelPayload)
        assert queue.take(now_ns) is None
        assert last_ns is None or now_ns - last_ns == 20_000_000
        last_ns = now_ns
        taken.append(item.payload)
    assert taken == expected


@given(st.lists(st.integers(0, 60_000_000), min_size=2, max_size=50))
def test_late_wake_ups_never_bring_two_messages_closer_than_the_floor(
    lateness_ns: list[int],
) -> None:
    queue = PacedQueue(0.020)
    for _ in lateness_ns:
        queue.put(TunnelPayload(b""), Priority.STATUS)
    times, now_ns = [], START_NS
    for late_ns in lateness_ns:
        now_ns += (queue.wait_ns(now_ns) or 0) + late_ns
        assert queue.take(now_ns) is not None
        times.append(now_ns)
    gaps = [after - before for before, after in pairwise(times)]
    assert min(gaps) >= 12_000_000


@given(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=390))
def test_a_text_of_any_length_comes_back_from_its_pieces(text: str) -> None:
    pieces = chunks_of(text, 6, 1)
    assert all(len(piece.text.encode()) <= 50 for piece in pieces)
    assembler = TextAssembler()
    done = []
    for piece in pieces:
        received = Statustext.decode(piece.pack())
        done += assembler.add((1, 191), received)
    ((severity, whole),) = done
    assert severity == 6
    # Padding may stand where a character of several bytes did not fit a piece.
    assert whole.replace(" ", "")[:300] == text.replace(" ", "")[:300]


@settings(max_examples=150)
@given(
    st.lists(st.tuples(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=255)), max_size=5),
    st.tuples(st.integers(0, 255), st.integers(0, 255)),
)
def test_no_content_of_any_message_disturbs_the_component_or_the_autopilot(
    contents: list[tuple[int, bytes]], sender: tuple[int, int]
) -> None:
    given_out: list[object] = []
    handlers = Handlers(
        attitude=given_out.append,
        position=given_out.append,
        tunnel=lambda payload, peer: given_out.append(payload),
    )
    component = Component(lambda message: None, handlers)
    clock = Clock.start()
    settings_ = AutopilotSettings(companion=("127.0.0.1", 9))
    autopilot = FakeAutopilot(demo_scenario().vehicle_pose, settings_, clock)
    for message_id, payload in contents:
        message = MESSAGES[message_id].decode(payload)
        raw = FrameWriter(*sender).encode(message)
        (frame,) = FrameParser().feed(raw)
        component.receive(frame, clock.now_ns())
        component.tick(clock.now_ns())
        autopilot.receive(autopilot.companion, frame, clock.now_ns())
        autopilot.step(clock.now_ns())
    tunnels = sum(MESSAGES[number] is Tunnel for number, _ in contents)
    assert len(given_out) <= tunnels + len(contents)


def test_struct_sizes_hold_no_hidden_pads() -> None:
    for kind in MESSAGES.values():
        assert kind.LAYOUT.format.startswith("<")
    assert Ping.LAYOUT.size == struct.calcsize("<QIBB")
