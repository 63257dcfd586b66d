"""Whatever happens in whatever order: nothing moves the drone without a present confirmation.

``make claims`` explores as deep as the promises name: ``UAVRT_DEPTH=12`` the authority alone,
``UAVRT_LINK_DEPTH=8`` with an attacker on its link.
"""

import os
from collections.abc import Callable

import pytest
from attacked_world import AttackedWorld, WorldClock, in_its_time
from authority_world import KEYS, World
from explored import assert_equal_states_stay_equal, explore

from uavrt.core.errors import TunnelError
from uavrt.guidance.control.offers import Offers
from uavrt.link.tunnel.gate import Gate, Sealer
from uavrt.link.tunnel.own_messages.seal import SealKeeper
from uavrt.simulation.vehicle.airframe import Flavour

DEPTH = int(os.environ.get("UAVRT_DEPTH", "7"))
LINK_DEPTH = int(os.environ.get("UAVRT_LINK_DEPTH", "4"))


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.timeout(1800)
def test_no_interleaving_moves_the_drone_unconfirmed_and_take_back_always_works(
    flavour: Flavour,
) -> None:
    counts = explore(World.flying(flavour), DEPTH, KEYS)
    print(f"{flavour}, depth {DEPTH}: {dict(counts)}")
    for standing in ("out", "confirmed", "in command"):
        assert counts[standing] > 20, counts


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.timeout(3600)
def test_no_attacker_on_the_link_moves_the_drone_prevents_take_back_or_hides_link_loss(
    flavour: Flavour,
) -> None:
    with in_its_time():
        counts = explore(AttackedWorld(flavour), LINK_DEPTH, KEYS)
    print(f"{flavour} attacked, depth {LINK_DEPTH}: {dict(counts)}")
    for standing in ("out", "confirmed", "in command"):
        assert counts[standing] > 20, counts


def test_states_that_are_merged_lead_to_equal_states() -> None:
    assert assert_equal_states_stay_equal(World.flying("px4"), 5, KEYS) > 500
    with in_its_time():
        assert assert_equal_states_stay_equal(AttackedWorld("px4"), 3, KEYS) > 100


def test_the_exploration_finds_an_authority_that_keeps_an_offer_after_take_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Offers, "clear", lambda _: None)
    with pytest.raises(AssertionError, match="confirmed"):
        explore(World.flying("px4"), 3, KEYS)


def _no_freshness(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drone that accepts a replayed seal."""
    opened = SealKeeper.open

    def open_again(self: SealKeeper, *payload_and_places: object) -> tuple[int, bytes]:
        self._newest.clear()
        return opened(self, *payload_and_places)  # type: ignore[arg-type]

    monkeypatch.setattr(SealKeeper, "open", open_again)


def _any_session(monkeypatch: pytest.MonkeyPatch) -> None:
    """A station that uses the session announced last."""
    accept = Sealer.accept_session

    def believing(self: Sealer, payload: bytes, drone: tuple[int, int]) -> None:
        accept(self, payload, drone)
        self._session = next(reversed(self._announced), self._session)

    monkeypatch.setattr(Sealer, "accept_session", believing)


def _unproven_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A station that accepts answers without checking the proof."""

    def believing(_: Sealer, payload: bytes, numbers: tuple[int, ...]) -> bytes:
        if not numbers:
            raise TunnelError("nothing is asked", payload)
        first, number = payload[0], numbers[0].to_bytes(4, "little")
        return bytes((1, first & 15, first >> 4, 0)) + number + payload[8:]

    monkeypatch.setattr(Sealer, "answer", believing)


def _anything_is_life(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drone that counts a forged sealed frame as a sign of life."""
    opened = Gate.open

    def alive(self: Gate, *payload_and_places: object) -> tuple[int, bytes] | None:
        got = opened(self, *payload_and_places)  # type: ignore[arg-type]
        self._sealed_s[(254, 190)] = WorldClock.now_s
        return got

    monkeypatch.setattr(Gate, "open", alive)


@pytest.mark.parametrize(
    ("break_it", "found"),
    [
        (_no_freshness, "forged, repeated or overtaken"),
        (_any_session, "session of yesterday"),
        (_unproven_answers, "forged answer"),
        (_anything_is_life, "loss not noticed|changed something"),
    ],
)
def test_the_exploration_finds_each_defect_of_a_link(
    break_it: Callable[[pytest.MonkeyPatch], None], found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    break_it(monkeypatch)
    with in_its_time(), pytest.raises(AssertionError, match=found):
        explore(AttackedWorld("px4"), 3, KEYS)
