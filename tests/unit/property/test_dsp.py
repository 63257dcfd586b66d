import made
import numpy as np
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st
from original_tuner import original_center

from uavrt.core.errors import TunerError
from uavrt.core.messages import ChannelBlock, IQBlock
from uavrt.dsp.channelizer import Channelizer
from uavrt.dsp.decimator import Decimator, Mode
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.tuner import compatible_cost, tune

Complex = np.ndarray[tuple[int], np.dtype[np.complex64]]
RATE_HZ = 3e6
CENTER_HZ = 150e6
START_NS = 1_700_205_419_000_000_000

cuts = st.lists(st.integers(0, 20_000), max_size=30)
MODES: tuple[Mode, ...] = ("default", "compatible")
modes = st.sampled_from(MODES)


def noise(count: int, seed: int) -> Complex:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((count, 2), dtype=np.float32).view(np.complex64)[:, 0]


def pieces(samples: Complex, at: list[int]) -> list[Complex]:
    return np.split(samples, sorted(min(cut, samples.size) for cut in at))


def block(samples: Complex, index: int, lost: int = 0) -> IQBlock:
    return made.iq_block(samples, index, RATE_HZ, start_ns=START_NS, lost_before=lost)


@settings(max_examples=25)
@given(st.integers(2, 24), modes, cuts, st.integers(0, 9))
def test_a_decimator_does_not_care_how_its_input_is_cut(
    factor: int, mode: Mode, at: list[int], seed: int
) -> None:
    decimator = Decimator(factor=factor, mode=mode)
    samples = noise(20_000, seed)
    whole = decimator.process(samples)
    decimator.reset()
    parts = np.concatenate([decimator.process(part) for part in pieces(samples, at)])
    np.testing.assert_allclose(parts, whole, atol=1e-5)


@settings(max_examples=25)
@given(
    st.integers(1, 60).map(lambda half: 2 * half),
    modes,
    cuts,
    st.integers(1, 120),
    st.integers(0, 9),
)
def test_a_channelizer_does_not_care_how_its_input_is_cut(
    channels: int, mode: Mode, at: list[int], used: int, seed: int
) -> None:
    bank = Channelizer(channels=channels, mode=mode, in_use=range(min(used, channels)))
    samples = noise(20_000, seed)
    whole = bank.process(samples)
    bank.reset()
    parts = [bank.process(part) for part in pieces(samples, at)]
    np.testing.assert_allclose(np.concatenate(parts, axis=1), whole, atol=1e-5)


@settings(max_examples=25)
@given(modes, st.integers(0, 10_000), st.lists(st.integers(1, 60_000), max_size=12))
def test_a_front_end_gives_the_same_samples_and_times_however_it_is_fed(
    mode: Mode, start: int, lengths: list[int]
) -> None:
    front_end = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=CENTER_HZ,
        frequencies_hz=[CENTER_HZ - 20_000, CENTER_HZ + 71_000],
        mode=mode,
    )
    samples = noise(100_000, 5)
    whole = front_end.process(block(samples, start))
    front_end.reset()
    rows: list[list[ChannelBlock]] = [[], []]
    ends = np.cumsum(lengths)
    index = start
    for part in pieces(samples, [int(end) for end in ends]):
        for row, channel in zip(rows, front_end.process(block(part, index)), strict=False):
            row.append(channel)
        index += part.size
    for row, reference in zip(rows, whole, strict=True):
        joined = np.concatenate([channel.samples for channel in row])
        np.testing.assert_allclose(joined, reference.samples, atol=1e-5)
        next_index = reference.sample_index
        for channel in row:
            assert channel.sample_index == next_index
            assert channel.lost_before == 0
            ahead = (next_index - reference.sample_index) / reference.sample_rate_hz
            assert abs(channel.time_ns - reference.time_ns - ahead * 1e9) < 3
            next_index += channel.samples.size


@settings(max_examples=30)
@given(
    first=st.integers(0, 5_000),
    before=st.integers(0, 120_000),
    gap=st.one_of(st.integers(0, 200), st.integers(0, 20_000_000)),
    place=st.integers(0, 3_000),
    offset_hz=st.integers(-125_000, 125_000),
)
def test_a_pulse_after_a_gap_has_the_right_time(
    first: int, before: int, gap: int, place: int, offset_hz: int
) -> None:
    front_end = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=CENTER_HZ,
        frequencies_hz=[CENTER_HZ + offset_hz],
    )
    rng = np.random.default_rng(1)
    quiet = (1e-6 * rng.standard_normal(before)).astype(np.complex64)
    resumed = first + before + gap
    # Clear of the edge of the gap by more than the filters' length (3200 samples).
    start = resumed + 5_000 + place
    index = np.arange(start, start + 60_000)
    pulse = np.hanning(60_000) * np.exp(2j * np.pi * offset_hz / RATE_HZ * index)
    samples = np.zeros(90_000, dtype=np.complex64)
    samples[5_000 + place : 65_000 + place] = pulse
    blocks = front_end.process(block(quiet, first))
    blocks += front_end.process(block(samples, resumed, gap))
    power = time = 0.0
    next_index: int | None = None
    for part in blocks:
        if next_index is not None:
            assert part.sample_index == next_index + part.lost_before
        next_index = part.sample_index + part.samples.size
        # Where an index stands is fixed for all time: band sample 50 n, input 400 n.
        stands_at = part.sample_index * 400 / RATE_HZ - front_end.plan.latency_s
        assert abs(part.time_ns - START_NS - stands_at * 1e9) < 5
        weights = np.abs(part.samples.astype(np.complex128)) ** 2
        times = part.time_ns - START_NS + np.arange(weights.size) / part.sample_rate_hz * 1e9
        power += float(weights.sum())
        time += float(weights @ times)
    expected = (start + 59_999 / 2) / RATE_HZ * 1e9
    assert abs(time / power - expected) < 1_000


@settings(max_examples=40)
@given(st.lists(st.integers(0, 240_000), min_size=2, max_size=12))
def test_the_tuner_keeps_its_guards_and_is_never_worse_than_the_original(
    offsets: list[int],
) -> None:
    tags = np.array([148.6e6 + offset for offset in offsets])
    try:
        plan = tune(list(tags))
    except TunerError:
        # Up to 12 tags block 24 kHz of radio frequencies; they span at most 240 of 252 kHz.
        assert np.ptp(tags) > 252_000 - 2_000 * (len(offsets) + 1)
        return
    center = np.array([plan.center_frequency_hz])
    relative = tags - center
    assert np.abs(relative).max() <= 126_000
    assert np.abs(relative).min() >= 1_000
    layout = {"spacing_hz": 3750.0, "channel_count": 100}
    theirs = np.array([original_center(tags)])
    their_relative = tags - theirs
    # The original knows no guards; where they exclude its choice there is nothing to compare.
    assume(np.abs(their_relative).max() <= 126_000 and np.abs(their_relative).min() >= 1_000)
    ours_cost = compatible_cost(tags, center, **layout)  # type: ignore[arg-type]
    their_cost = compatible_cost(tags, theirs, **layout)  # type: ignore[arg-type]
    ours = (round(float(ours_cost.tags_per_channel[0]), 9), float(ours_cost.edge_cost[0]))
    assert ours <= (
        round(float(their_cost.tags_per_channel[0]), 9),
        float(their_cost.edge_cost[0]) + 1e-8,
    )


@settings(max_examples=40)
@given(st.lists(st.integers(0, 251_000), min_size=1, max_size=12))
def test_each_tag_is_where_the_tuner_says(offsets: list[int]) -> None:
    tags = [148.6e6 + offset for offset in offsets]
    try:
        plan = tune(tags)
    except TunerError:
        reject()
    front_end = FrontEnd(
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=plan.center_frequency_hz,
        frequencies_hz=tags,
    )
    for tag, channel, offset in zip(tags, plan.channels, plan.offsets_hz, strict=True):
        place = front_end.plan.frequency_channels[tags.index(tag)]
        # A tag half-way between two centres may be told either way by rounding.
        assert place == channel or abs(offset) == 1875
        assert abs(offset) <= 1875
