"""Every channel of the remote control is a pilot's hand, and must be told often enough."""

import random

import pytest
from flown import HOME, Flown

from uavrt.config.loader import parse_settings
from uavrt.core.errors import CommandRefused, ConfigError
from uavrt.core.messages import FlyThere
from uavrt.guidance.control.authority import ControlStage
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
LOW = (1000,) * 6


def surveying(flavour: Flavour, unwatched: frozenset[int] = frozenset()) -> Flown:
    """One that has flown a survey for some seconds, with a switch on each channel."""
    flown = Flown(flavour, sticks=True, unwatched_channels=unwatched)
    flown.switches = LOW
    flown.run(1.0)
    corners = ((40, 10), (45, 60), (80, 55), (85, 5))
    places = tuple(flown.place(*corner) for corner in corners)
    flown.order("survey", places=places, spacing_m=20.0, height_m=40.0)
    flown.run(6.0)
    assert flown.authority.standing is ControlStage.IN_COMMAND
    return flown


@BOTH
def test_a_mode_switch_flipped_to_our_own_mode_is_a_takeover(flavour: Flavour) -> None:
    """PX4 flies our survey in Hold: neither its mode nor its target changes."""
    flown = surveying(flavour)
    sent = len(flown.commands)
    flown.switches = (2000, *LOW[1:])
    flown.vehicle.set_mode(MODES[flavour]["hold"])
    flown.run(0.4)
    assert flown.authority.reason == (
        "RC channel 5 was switched (guidance.unwatched_channels leaves it out)"
    )
    flown.run(20.0)
    assert len(flown.commands) == sent


@BOTH
def test_a_switch_is_believed_after_a_tenth_of_a_second_without_another_word(
    flavour: Flavour,
) -> None:
    flown = surveying(flavour)
    flown.run(1.0, until=lambda: flown.steps % 4 == 0)
    flown.switches = (*LOW[:3], 1300, *LOW[4:])
    flown.step()
    assert flown.authority.standing is ControlStage.IN_COMMAND
    flown.sticks_every = 1000
    flown.run(0.15)
    assert flown.authority.reason.startswith("RC channel 8 was switched")


def command(flown: Flown, order_id: int | None) -> None:
    latitude, longitude = flown.place(30.0, 30.0)
    there = FlyThere(
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=HOME.altitude_amsl_m + 40.0,
    )
    assert order_id is not None
    flown.authority.command(order_id, there, flown.time_s)


@BOTH
def test_nothing_is_commanded_while_a_switch_may_have_been_moved(flavour: Flavour) -> None:
    flown = surveying(flavour)
    flown.run(3.0, until=lambda: flown.authority.obeyed and flown.steps % 4 == 0)
    order_id, flown.execution = flown.authority.order_id, None
    flown.switches = (*LOW[:5], 1500)
    flown.step()
    with pytest.raises(CommandRefused, match="an RC switch was moved"):
        command(flown, order_id)


@BOTH
def test_one_slip_of_the_receiver_is_no_hand(flavour: Flavour) -> None:
    flown = surveying(flavour)
    flown.sticks_every = 2
    flown.run(1.0, until=lambda: flown.steps % 2 == 0)
    flown.switches = (2000, *LOW[1:])
    flown.step()
    flown.switches = LOW
    flown.run(2.0)
    assert flown.authority.standing is ControlStage.IN_COMMAND


@BOTH
def test_a_channel_that_is_left_out_may_tell_what_it_likes(flavour: Flavour) -> None:
    flown = surveying(flavour, frozenset({7, 9}))
    rng = random.Random(3)
    for _ in range(30):
        rssi, other = rng.randint(900, 2100), rng.randint(900, 2100)
        flown.switches = (*LOW[:2], rssi, LOW[3], other, LOW[5])
        flown.run(0.1)
    assert flown.authority.standing is ControlStage.IN_COMMAND
    flown.switches = (*flown.switches[:5], 2000)
    flown.run(0.4)
    assert flown.authority.reason.startswith("RC channel 10 was switched")


@BOTH
def test_a_channel_that_is_told_no_more_was_switched(flavour: Flavour) -> None:
    flown = surveying(flavour)
    flown.switches = LOW[:4]
    flown.run(0.4)
    assert flown.authority.reason.startswith("RC channel 9 was switched")


@BOTH
def test_a_switch_moved_while_the_operator_thinks_takes_the_offer_away(
    flavour: Flavour,
) -> None:
    flown = Flown(flavour, sticks=True)
    flown.switches = LOW
    flown.run(1.0)
    flown.authority.offer(1, 77, flown.time_s)
    flown.switches = (*LOW[:2], 1500, *LOW[3:])
    flown.run(1.0)
    with pytest.raises(CommandRefused, match="RC channel 7 was switched"):
        flown.authority.confirm(1, 77, flown.time_s)
    flown.authority.offer(1, 78, flown.time_s)
    flown.authority.confirm(1, 78, flown.time_s)


@pytest.mark.parametrize("channel", [4, 19])
def test_only_channels_that_are_no_sticks_can_be_left_out(channel: int) -> None:
    text = f"[guidance]\nunwatched_channels = [{channel}]\n"
    with pytest.raises(ConfigError, match="unwatched_channels"):
        parse_settings(text.encode(), name="uavrt.toml")
    assert parse_settings(
        b"[guidance]\nunwatched_channels = [5, 18]\n", name="uavrt.toml"
    ).guidance.unwatched_channels == (5, 18)


@BOTH
def test_sticks_told_every_1_4_s_are_no_sticks_to_confirm_by(flavour: Flavour) -> None:
    flown = Flown(flavour, sticks=True)
    flown.sticks_every = 28
    flown.run(3.0, until=lambda: flown.steps % 28 == 15)
    flown.authority.offer(1, 77, flown.time_s)
    with pytest.raises(CommandRefused, match=r"reported less often than every 0\.3 s"):
        flown.authority.confirm(1, 77, flown.time_s)


@BOTH
def test_no_command_leaves_on_sticks_of_half_a_second_ago(flavour: Flavour) -> None:
    flown = surveying(flavour)
    flown.run(3.0, until=lambda: flown.authority.obeyed and flown.steps % 4 == 1)
    order_id, flown.execution = flown.authority.order_id, None
    flown.sticks_every = 1000
    flown.run(0.4)
    with pytest.raises(CommandRefused, match=r"RC report is older than 0\.3 s"):
        command(flown, order_id)
    flown.sticks_every = 4
    flown.run(0.2)
    command(flown, order_id)


@BOTH
def test_slow_sticks_are_watched_all_the_same_once_the_operator_knows(flavour: Flavour) -> None:
    flown = Flown(flavour, sticks=True)
    flown.sticks_every = 28
    flown.run(3.0, until=lambda: flown.steps % 28 == 15)
    flown.authority.offer(1, 77, flown.time_s)
    flown.authority.confirm(1, 77, flown.time_s, sticks_unseen=True)
    flown.run(3.0)
    assert flown.authority.standing is ControlStage.CONFIRMED
    flown.channels = (1900, *flown.channels[1:])
    flown.run(1.5)
    assert flown.authority.reason == "the sticks were moved"
