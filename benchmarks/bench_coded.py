"""The search for coded tags on one channel: what it costs, and how often it names a wrong one.

False identities at the limits of flights are too rare to be waited for. They are counted at
limits for 1, 3 and 10 in an hour and code, beside a code 20 dB above what one burst needs, that
is listed or is not; a power law through the counts is read off at 1e-4. More stretches make its
interval narrower: UAVRT_STRETCHES=100 python -m benchmarks coded.
"""

import math
import os
from collections.abc import Sequence

import numpy as np

from benchmarks.harness import Case, Table, compare
from uavrt.core.clock import cpu_s
from uavrt.detection.coded.coded_detector import CodedDetector
from uavrt_experiments.detection.coded import RATE_HZ, WINDOW_HZ, add_burst, mistake, some_codes
from uavrt_experiments.detection.signals import START_NS, noise
from uavrt_experiments.statistics import count_interval

BLOCK = 655
SIGNAL_S = 20.0
BAR = 1e-4
"""False identities in an hour and code."""
LOWERED = (1.0, 3.0, 10.0)
STRETCHES, STRETCH_S = 10, 200.0
ASKED = "UAVRT_STRETCHES"
CODES, STRONG_DB = 50, 30.0


def run() -> list[Table]:
    """All tables of this section."""
    stretches = stretches_asked()
    return [
        compare(
            "Coded tags on one channel, ± 500 Hz, 7500 S/s, blocks of 87 ms",
            [
                case("noise, one code", 1),
                case("noise, 50 codes", 50),
                case("noise, 500 codes", 500),
                case("ten tags of 20 dB, 500 codes", 500, senders=10),
            ],
            rounds=2,
            in_a_row=1,
            notes=["Bar: 500 codes 10 %."],
        ),
        wrong_identities(listed=True, stretches=stretches),
        wrong_identities(listed=False, stretches=stretches),
    ]


def stretches_asked() -> int:
    """Stretches for each lowered limit: ten, or what ``UAVRT_STRETCHES`` says."""
    asked = os.environ.get(ASKED, f"{STRETCHES}")
    if not asked.isdecimal() or int(asked) < 2:
        raise SystemExit(f"{ASKED} is {asked!r}: give a number of stretches from 2 on")
    return int(asked)


def wrong_identities(
    *, listed: bool, stretches: int = STRETCHES, stretch_s: float = STRETCH_S
) -> Table:
    """Count false identities at lowered limits, and read them off at those of flights."""
    hours = CODES * stretches * stretch_s / 3600.0
    begun_s = cpu_s()
    chances = CODES * stretches
    wrong = [_wrong(nominal, stretches, stretch_s, listed=listed) for nominal in LOWERED]
    # Each tag counts once in a stretch: where many are wrong, some would be twice.
    counts = [-chances * math.log1p(-min(n, chances - 1) / chances) for n in wrong]
    own = _wrong(BAR, stretches // 2, stretch_s, listed=listed)
    rows = [
        [f"limits for {nominal:g}", f"{seen}", f"{count / hours:.3g}", ""]
        for nominal, seen, count in zip(LOWERED, wrong, counts, strict=True)
    ]
    low, high = (bound / (0.5 * hours) for bound in count_interval([own]))
    told = f"{2.0 * own / hours:.2g} ({low:.2g} … {high:.2g})" if own else f"≤ {high:.2g}"
    rows.append([f"limits for {BAR:g}, counted", f"{own}", told, ""])
    rows.append([f"limits for {BAR:g}, from the power law", "", *_at_the_bar(counts, hours)])
    sender = "a listed one" if listed else "one that is not listed, but sends,"
    return Table(
        title=f"False identities of {CODES} codes beside {sender} of {STRONG_DB:g} dB",
        header=["", "wrong tags", "in an hour and code", "bar"],
        rows=rows,
        notes=[
            f"{stretches} stretches of {stretch_s:g} s for each lowered limit "
            f"({ASKED} sets how many), {hours:.0f} hours times codes; "
            f"{cpu_s() - begun_s:.0f} s of CPU. ≤: upper 95 % limit; …: 95 % interval.",
            "The power law is a Poisson fit; it says nothing of mistakes that do not hang on "
            "the limits, of which only the counted line does.",
        ],
    )


def _at_the_bar(counts: Sequence[float], hours: float) -> tuple[str, str]:
    """Figure and verdict at the limits of flights; a line needs two counts at least."""
    if sum(count > 0.0 for count in counts) < 2:
        return "too few were seen for it", f"≤ {BAR:g}: not shown"
    low, figure, high = extrapolated(counts, [hours] * len(counts))
    verdict = "met" if figure <= BAR else "not met"
    verdict += ", within error" if low <= BAR < high else ""
    return f"{figure:.2g} ({low:.2g} … {high:.2g})", f"≤ {BAR:g}: {verdict}"


def _wrong(nominal: float, stretches: int, stretch_s: float, *, listed: bool) -> int:
    return sum(
        mistake(
            np.random.default_rng([7, round(nominal), number]),
            strong_db=STRONG_DB,
            seconds=stretch_s,
            nominal=nominal,
            listed=listed,
            unlisted=not listed,
        ).wrong
        for number in range(stretches)
    )


def extrapolated(counts: Sequence[float], hours: Sequence[float]) -> tuple[float, float, float]:
    """Rate at the limits of flights by a power law, between the ends of its 95 % interval.

    The logarithm of a Poisson count's mean is a line in that of the limit; iterated weighted
    least squares are its maximum likelihood (McCullagh and Nelder 1989, section 2.5).

    `counts`: at each of the lowered limits; more than none.
    `hours`: times codes.
    """
    known = np.stack((np.ones(len(counts)), np.log(LOWERED)), axis=1)
    seen, offset = np.asarray(counts, float), np.log(hours)
    line = np.array([math.log(max(seen.sum(), 1.0) / sum(hours)), 1.0])
    for _ in range(50):
        mean = np.exp(known @ line + offset)
        weight = known.T * mean
        line = line + np.linalg.solve(weight @ known, known.T @ (seen - mean))
    spread = np.linalg.inv((known.T * np.exp(known @ line + offset)) @ known)
    there = np.array([1.0, math.log(BAR)])
    middle, error = float(there @ line), math.sqrt(float(there @ spread @ there))
    low, figure, high = (math.exp(middle + sigmas * error) for sigmas in (-1.96, 0.0, 1.96))
    return low, figure, high


def case(name: str, codes: int, *, senders: int = 0) -> Case:
    """One channel's search, with the first few of the codes on air."""
    rng = np.random.default_rng(1)
    tags = some_codes(rng, codes)
    samples = noise(rng, round(SIGNAL_S * RATE_HZ))
    for tag in tags[:senders]:
        at_s, offset_hz = rng.uniform(0.0, 5.0), rng.uniform(-WINDOW_HZ, WINDOW_HZ)
        while at_s + tag.length_s < SIGNAL_S:
            add_burst(
                *(samples, tag),
                start_s=at_s,
                offset_hz=offset_hz,
                enr_db=20.0,
                stretch=0.0,
                rng=rng,
            )
            at_s += tag.pulse_intervals_s[0]
    detector = CodedDetector(
        tags,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=tags[0].frequency_hz,
        frequency_window_hz=WINDOW_HZ,
    )
    position = 0

    def go() -> None:
        nonlocal position
        for first in range(0, len(samples), BLOCK):
            block = samples[first : first + BLOCK]
            detector.process(block, START_NS + round(position / RATE_HZ * 1e9))
            position += len(block)

    return Case(name=name, run=go, signal_s=SIGNAL_S)
