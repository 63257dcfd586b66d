"""Messages that wait for the gateway: each topic has its own limits, and all are counted."""

import random
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.inbox import BYTES_OF_ONE, Inbox, SendingOrder
from uavrt.link.ros2.ros_senders import Arrival, Sender

OPERATOR = Sender(key="operator")
GATEWAY = Sender(key="gateway", gateway=True)
HEARD = sorted(name for name, topic in TOPICS.items() if topic.subscribers)
STOP = "control_stop_subprocess"


def arrival(topic: str, number: int = 0, size: int = 100, sender: Sender = OPERATOR) -> Arrival:
    return Arrival(topic=TOPICS[topic], cdr=bytes(size), sent_ns=number, sender=sender)


@given(
    st.lists(
        st.tuples(st.sampled_from(HEARD), st.integers(0, 5000), st.booleans()), max_size=300
    )
)
def test_each_message_is_taken_or_counted(messages: list[tuple[str, int, bool]]) -> None:
    inbox = Inbox(lambda: 0, closed=("pulse",))
    for number, (topic, size, of_gateway) in enumerate(messages):
        inbox.put(arrival(topic, number, size, GATEWAY if of_gateway else OPERATOR))
    taken = inbox.take()
    assert len(taken) + sum(inbox.dropped.values()) + inbox.of_gateways == len(messages)
    assert all(one.sender == OPERATOR for one in taken)
    numbers = [one.sent_ns for one in taken if one.topic.commands]
    assert numbers == sorted(numbers), "orders stay in their order"
    assert inbox.take() == []


@given(st.sampled_from([name for name in HEARD if name != STOP]), st.integers(0, 10**6))
def test_a_flood_of_one_topic_costs_no_message_of_another(topic: str, seed: int) -> None:
    rng = random.Random(seed)
    now_ns = 0
    inbox = Inbox(lambda: now_ns)
    taken: Counter[str] = Counter()
    for second in range(10):
        for _ in range(rng.randrange(1, 1000)):
            inbox.put(arrival(topic, size=rng.randrange(10_000)))
        inbox.put(arrival(STOP, second))
        taken.update(one.topic.name for one in inbox.take())
        now_ns += 1_000_000_000
    assert taken[STOP] == 10
    row = TOPICS[topic]
    assert taken[topic] <= row.burst + 10 * row.per_s
    assert STOP not in inbox.dropped


def test_a_long_message_counts_as_several_and_an_enormous_one_is_never_decoded() -> None:
    inbox = Inbox(lambda: 0)
    burst = TOPICS[STOP].burst
    inbox.put(arrival(STOP, size=BYTES_OF_ONE * burst + 1))
    assert inbox.dropped == {STOP: 1}
    inbox.put(arrival(STOP, size=BYTES_OF_ONE * burst))
    assert len(inbox.take()) == 1
    inbox.put(arrival(STOP, size=1))
    assert inbox.dropped == {STOP: 2}


def test_pulses_wait_behind_commands() -> None:
    inbox = Inbox(lambda: 0)
    inbox.put(arrival("pulse"))
    inbox.put(arrival(STOP))
    assert [one.topic.name for one in inbox.take()] == [STOP, "pulse"]


@given(st.integers(1, 5), st.integers(0, 200), st.integers(0, 10**6))
def test_messages_that_come_while_the_readers_are_emptied_stay_in_their_order(
    readers: int, count: int, seed: int
) -> None:
    """One sender writes to several readers in turn; each comes at any moment of a pass."""
    rng = random.Random(seed)
    waiting: list[list[int]] = [[] for _ in range(readers)]
    coming = iter([(number, rng.randrange(readers)) for number in range(count)])
    in_order: SendingOrder[int] = SendingOrder(lambda number: (number,))
    taken: list[int] = []
    for _ in range(20 * count + 2):
        found: list[int] = []
        for reader in waiting:
            found += reader
            reader.clear()
            for _ in range(rng.randrange(3)):
                if (one := next(coming, None)) is not None:
                    waiting[one[1]].append(one[0])
        taken += in_order.add_pass(found)
    assert taken == list(range(count))
