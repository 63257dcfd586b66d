"""The autopilot's queue against what was measured of a real one."""

import itertools

import made
import pytest

from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.simulation.vehicle.forwarding import ForwardRing, Impairment, Routes

START_NS = 1_700_000_000 * 10**9


def tunnel_frame(size: int = 128) -> Frame:
    message = made.tunnel(0, b"\xff" * size, target_system=255, payload_length=size)
    (frame,) = FrameParser().feed(FrameWriter(1, 191).encode(message))
    return frame


@pytest.mark.parametrize(("size", "expected"), [(92, 5), (128, 3)])
def test_a_burst_survives_as_measured(size: int, expected: int) -> None:
    ring = ForwardRing()
    assert sum(ring.push(tunnel_frame(size)) for _ in range(10)) == expected


def test_a_late_look_at_the_ring_gives_all_passes_since() -> None:
    ring = ForwardRing()
    assert ring.passes(START_NS) == []
    for _ in range(3):
        ring.push(tunnel_frame())
    assert len(ring.passes(START_NS + 9_000_000)) == 2
    assert len(ring.passes(START_NS + 11_000_000)) == 0
    assert len(ring.passes(START_NS + 12_000_000)) == 1


def test_an_addressed_message_goes_only_where_its_target_was_seen() -> None:
    routes = Routes()
    assert not routes.leads_to(255, 190)
    assert routes.leads_to(0, 0)
    routes.saw(tunnel_frame())
    assert routes.leads_to(1, 191)
    assert routes.leads_to(1, 0)
    assert not routes.leads_to(1, 25)


def test_impairments_repeat_with_their_seed_and_keep_the_order() -> None:
    def run(seed: int) -> list[int | None]:
        link = Impairment(loss=0.2, jitter_s=0.010, seed=seed)
        return [link.release_ns(START_NS + step * 1_000_000) for step in range(2000)]

    first = run(1)
    assert first == run(1) != run(2)
    kept = [time_ns for time_ns in first if time_ns is not None]
    assert all(before <= after for before, after in itertools.pairwise(kept))
    assert 340 <= first.count(None) <= 460  # 400 expected, sigma 18
