"""The search for all that beeps, beside 100 tags: cost over whole periods of its turns."""

import itertools
from collections.abc import Callable, Iterator

import numpy as np

from benchmarks.harness import Case, Table, compare
from uavrt.config.ghost_places import Receiver
from uavrt.core.messages import IQBlock, Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.detection.beeps.tuning import LISTENING
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG

RADIO_HZ, BAND_HZ = 3e6, 375e3
CENTER_HZ = 148_700_000.0
BLOCK_S = 0.08
TAGS = tuple(
    Tag(
        tag_id=2 * number + 2,
        frequency_hz=CENTER_HZ + 1e3 * (number - 50),
        pulse_width_s=THESIS_TAG.pulse_width_s,
        pulse_intervals_s=THESIS_TAG.pulse_intervals_s,
    )
    for number in range(100)
)


def run() -> list[Table]:
    """All tables of this section."""
    return [
        compare(
            "Search for all that beeps, live, beside 100 tags",
            [
                case("noise in the band of the tags, 375 kS/s", 90.0, whole=False),
                case("and in the radio's band, 3 MS/s", 540.0, whole=True),
            ],
            rounds=1,
            in_a_row=1,
            notes=["Bars: the band of the tags 0.5 %, with the radio's band 1.2 %."],
        )
    ]


def case(name: str, period_s: float, *, whole: bool) -> Case:
    """A search that holds all the points it keeps, since trains are searched among them."""
    search = BeepSearch(TAGS, 500.0, Receiver(CENTER_HZ, RADIO_HZ), live=True)
    blocks = endless(whole=whole)
    feed(search, blocks, LISTENING.recent_s)
    return Case(name=name, run=lambda: feed(search, blocks, period_s), signal_s=period_s)


def feed(
    search: BeepSearch, blocks: Iterator[tuple[IQBlock, IQBlock]], duration_s: float
) -> None:
    """Give blocks of some time to the search and take its news."""
    for block, band in itertools.islice(blocks, round(duration_s / BLOCK_S)):
        search.add(block, band)
        search.news(block.time_ns)


def endless(*, whole: bool) -> Iterator[tuple[IQBlock, IQBlock]]:
    """Noise of some seconds, again and again, as the radio gives it and decimated."""
    radio_hz = RADIO_HZ if whole else 1000.0
    make: Callable[[float, float], list[np.ndarray]] = noise_blocks
    radio, band = make(radio_hz, 7.2 if whole else 1.0), make(BAND_HZ, 28.8)
    rng = np.random.default_rng(2)
    for number in itertools.count():
        if number % len(radio) == 0:  # what comes again and again would be trains
            rng.shuffle(radio)
        if number % len(band) == 0:
            rng.shuffle(band)
        time_ns = START_NS + ns_from_s(number * BLOCK_S)
        yield (
            IQBlock(
                samples=radio[number % len(radio)],
                sample_index=round(number * BLOCK_S * radio_hz),
                time_ns=time_ns,
                sample_rate_hz=radio_hz,
            ),
            IQBlock(
                samples=band[number % len(band)],
                sample_index=round(number * BLOCK_S * BAND_HZ),
                time_ns=time_ns,
                sample_rate_hz=BAND_HZ,
            ),
        )


def noise_blocks(rate_hz: float, duration_s: float) -> list[np.ndarray]:
    """Blocks of white noise."""
    rng, size = np.random.default_rng(1), round(BLOCK_S * rate_hz)
    return [
        rng.standard_normal(2 * size, dtype=np.float32).view(np.complex64)
        for _ in range(round(duration_s / BLOCK_S))
    ]
