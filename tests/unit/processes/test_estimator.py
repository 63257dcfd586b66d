"""The estimator on the drone: which bearing is sent, and when again."""

from dataclasses import replace

import made

from uavrt.config.settings import BearingSettings, Settings
from uavrt.core.messages import LiveBearing
from uavrt.drone.processes.estimator import PERIOD_NS, REPEATS_NS, Outgoing
from uavrt.drone.supervisor.tree.process_shapes import rows_for
from uavrt.drone.supervisor.tree.table import consumers_of

SECOND = 1_000_000_000


def bearing(tag_id: int = 2, pulses: int = 3) -> LiveBearing:
    return made.live_bearing(
        tag_id,
        start_time_ns=0,
        end_time_ns=SECOND,
        turned_deg=90.0,
        latitude_deg=47.0,
        longitude_deg=8.5,
        bearing_deg=10.0,
        sigma_deg=5.0,
        interval90_deg=(2.0, 18.0),
        pulses=pulses,
    )


def sent(outgoing: Outgoing, until_ns: int, from_ns: int = 0) -> list[tuple[int, LiveBearing]]:
    return [
        (now_ns, one)
        for now_ns in range(from_ns, until_ns, PERIOD_NS // 2)
        if (one := outgoing.next_due(now_ns)) is not None
    ]


def test_the_estimator_is_one_row_that_the_settings_put_on_the_drone() -> None:
    """The table edit: its row, and the topic from it to the ground, are all there is to it."""
    usual = rows_for(Settings())
    asked = rows_for(Settings(bearings=BearingSettings(on_drone=True)))
    (row,) = set(asked) - set(usual)
    assert row.name == "estimator"
    assert set(row.consumes) == {"pulse_pose", "poses", "flight", "health"}
    assert [one.name for one in consumers_of("bearing")] == ["connection"]


def test_a_bearing_is_sent_at_once_and_again_after_longer_and_longer_times() -> None:
    outgoing = Outgoing()
    outgoing.put(bearing(), 0)
    times = [now_ns for now_ns, _ in sent(outgoing, 100 * SECOND)]
    assert times == [0, *(sum(REPEATS_NS[: n + 1]) for n in range(len(REPEATS_NS)))]


def test_a_newer_bearing_of_a_turn_takes_the_place_of_the_one_before() -> None:
    outgoing = Outgoing()
    outgoing.put(bearing(pulses=3), 0)
    assert sent(outgoing, SECOND)
    outgoing.put(bearing(pulses=4), SECOND)
    pulses = [one.pulses for _, one in sent(outgoing, 100 * SECOND, SECOND)]
    assert set(pulses) == {4}
    assert len(pulses) == 1 + len(REPEATS_NS)


def test_a_hundred_tags_get_their_turn_each() -> None:
    outgoing = Outgoing()
    for tag_id in range(100):
        outgoing.put(bearing(tag_id), tag_id)
    for tag_id in range(5):  # their next pulses come before the others have been sent
        outgoing.put(replace(bearing(tag_id), pulses=9), 1000 + tag_id)
    first = [one.tag_id for _, one in sent(outgoing, 100 * PERIOD_NS)]
    assert len(set(first)) > 85
    assert len(outgoing) == 100 - len(set(first))
    outgoing.clear()
    assert outgoing.next_due(10**12) is None
