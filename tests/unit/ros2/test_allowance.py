from hypothesis import given
from hypothesis import strategies as st

from uavrt.link.allowance import Allowance


@given(
    st.lists(st.integers(0, 10**10), min_size=1, max_size=200),
    st.integers(1, 20),
    st.floats(0.1, 50.0),
)
def test_no_more_is_given_than_the_burst_and_what_the_time_earns(
    steps_ns: list[int], burst: int, per_s: float
) -> None:
    allowance = Allowance(burst=burst, per_s=per_s)
    now_ns = given_out = 0
    for step_ns in steps_ns:
        now_ns += step_ns
        given_out += allowance.take(now_ns)
    earned = burst + (now_ns - steps_ns[0]) * 1e-9 * per_s
    assert min(burst, len(steps_ns)) <= given_out <= earned + 1e-6


def test_who_waits_long_enough_gets_again() -> None:
    allowance = Allowance(burst=1, per_s=2.0)
    given_ns = [t for t in (0, 1, 500_000_000, 500_000_001) if allowance.take(t)]
    assert given_ns == [0, 500_000_000]
