"""Named numbers and texts of tags: few, fair, never in a pulse's way."""

from collections import Counter
from dataclasses import replace

import made
from hypothesis import given
from hypothesis import strategies as st
from some import some

from uavrt.drone.processes.connection_parts.named_values import NamedValues
from uavrt.drone.processes.connection_parts.tag_texts import TagTexts
from uavrt.link.mavlink.dialect import MavAutopilot, MavState, MavType
from uavrt.link.mavlink.discovery import Discovery, Peer, station_heartbeat

S = 1_000_000_000
SLOW = made.tag(7, 148.7e6, 8.0, 2.0)


def taken(values: NamedValues, until_ns: int, step_ns: int = S // 20) -> list[tuple[int, str]]:
    found = []
    for now_ns in range(0, until_ns, step_ns):
        while (message := values.take(now_ns, 1200.0)) is not None:
            found.append((now_ns, message.name))
    return found


class Source:
    """Named values with a ground station, and pulses that wait, at will."""

    def __init__(self, which: str = "all") -> None:
        self.wanted, self.pulses_wait = True, False
        self.values = NamedValues(
            which,  # type: ignore[arg-type]
            wanted=lambda: self.wanted,
            pulses_wait=lambda: self.pulses_wait,
        )

    def hear(self, now_ns: int, *tags: int) -> None:
        for tag_id in tags:
            self.values.heard(made.pulse(now_ns, tag_id=tag_id), now_ns)


def test_a_hundred_tags_send_four_values_a_second_and_take_turns() -> None:
    source = Source()
    names: list[str] = []
    per_second: Counter[int] = Counter()
    for now_ns in range(0, 60 * S, S // 20):
        if now_ns % S == 0:
            source.hear(now_ns, *range(100))
        while (message := source.values.take(now_ns, 1200.0)) is not None:
            names.append(message.name)
            per_second[now_ns // S] += 1
    assert set(per_second.values()) == {4}
    assert len(per_second) == 60
    told = Counter(name.partition("_")[2] for name in names)
    assert set(told.values()) <= {2, 4}  # an SNR and a count each time
    assert len(told) == 100


def test_a_tag_is_told_once_a_second_with_its_newest_pulse_and_only_when_heard() -> None:
    source = Source()
    source.hear(0, 2, 2, 2)
    times = taken(source.values, 10 * S)
    assert [name for _, name in times] == ["SNR_2", "CNT_2"]
    source.hear(10 * S, 2)
    assert source.values.wait_ns(10 * S) == 0
    source.values.take(10 * S, 1200.0)
    assert source.values.take(10 * S, 1200.0) is None  # the count comes a quarter later
    count = some(source.values.take(10 * S + S // 4, 1200.0))
    assert count.value == 4
    source.hear(10 * S + S // 2, 2)
    assert source.values.wait_ns(10 * S + S // 2) == S // 2


@given(st.booleans(), st.booleans())
def test_nothing_leaves_unneeded_or_before_a_pulse(wanted: bool, pulses_wait: bool) -> None:
    source = Source()
    source.wanted, source.pulses_wait = wanted, pulses_wait
    source.hear(0, 2)
    free = wanted and not pulses_wait
    assert source.values.wait_ns(0) == (0 if free else None)
    assert (source.values.take(0, 1200.0) is not None) is free


def test_what_could_not_leave_for_five_seconds_is_old() -> None:
    source = Source()
    source.hear(0, 2)
    assert source.values.wait_ns(6 * S) is None


def test_the_setting_leaves_the_count_or_everything_out() -> None:
    for which, names in (("snr", ["SNR_2"]), ("off", [])):
        source = Source(which)
        source.hear(0, 2)
        assert [name for _, name in taken(source.values, 3 * S)] == names


def test_a_new_flight_counts_from_zero() -> None:
    source = Source()
    source.hear(0, 2, 2)
    source.values.begin_flight()
    assert taken(source.values, S) == []
    source.hear(2 * S, 2)
    source.values.take(2 * S, 1200.0)
    count = some(source.values.take(3 * S, 1200.0))
    assert (count.name, count.value) == ("CNT_2", 1.0)


def test_a_silence_is_thirty_seconds_or_ten_of_the_longest_interval() -> None:
    heard = TagTexts([SLOW])

    def text(tag_id: int, at_s: float) -> str | None:
        answer = heard.text(made.pulse(round(at_s * S), tag_id=tag_id))
        heard.reported(tag_id)
        return answer

    assert text(7, 0.0) == "Tag 7 detected: 20.0 dB"
    assert text(7, 79.0) is None
    assert text(7, 160.02) == "Tag 7 detected again after 81 s: 20.0 dB"
    assert text(9, 0.0) == "Tag 9 detected: 20.0 dB"
    assert text(9, 30.0) is None
    assert text(9, 5.0) is None  # late: it was not the newest
    assert text(9, 60.0) is None
    assert text(9, 90.1) == "Tag 9 detected again after 30 s: 20.0 dB"


def test_a_text_that_was_too_many_comes_with_the_next_pulse() -> None:
    heard = TagTexts()
    first = made.pulse(0, snr_db=10.0)
    assert heard.text(first) == "Tag 2 detected: 10.0 dB"
    assert heard.text(made.pulse(S, snr_db=11.0)) == "Tag 2 detected: 11.0 dB"
    heard.reported(2)
    assert heard.text(made.pulse(2 * S)) is None


def test_only_confirmed_pulses_make_a_text_and_doubt_is_told() -> None:
    heard = TagTexts([replace(SLOW, tag_id=2, name="lynx")])
    assert heard.text(made.pulse(0, confirmed=False)) is None
    doubtful = made.pulse(S, also_possible_tag_ids=(4,))
    assert heard.text(doubtful) == "Tag 2 (lynx) or 4 detected: 20.0 dB"


def test_ground_stations_of_others_are_told_from_ours_and_fall_silent() -> None:
    stock = made.heartbeat(
        type=MavType.GCS, autopilot=MavAutopilot.INVALID, system_status=MavState.ACTIVE
    )
    discovery = Discovery()
    discovery.heartbeat(Peer(254, 190), station_heartbeat(), 0)
    assert not discovery.other_station_present(0)
    discovery.heartbeat(Peer(255, 190), stock, 0)
    assert discovery.other_station_present(9 * S)
    assert not discovery.other_station_present(10 * S)
    for number in range(1, 40):  # a flood of ours pushes it out
        discovery.heartbeat(Peer(number, 190), station_heartbeat(), number * S)
    assert not discovery.other_station_present(40 * S)
    discovery.heartbeat(Peer(39, 190), stock, 40 * S)
    assert discovery.other_station_present(40 * S)
