"""E23: detection of coded tags by one, three or ten bursts; and false identities."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.clock import cpu_s
from uavrt.core.messages import Pulse, Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.coded.coded_detector import CodedDetector
from uavrt.detection.coded.slot_cells import Cells
from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.sensitivity import Shot, level_row
from uavrt_experiments.detection.signals import START_NS, TruePulse, add_pulse, noise
from uavrt_experiments.result import Row
from uavrt_experiments.statistics import count_interval

RATE_HZ = 7500.0
WINDOW_HZ = 500.0
THEORY_DB = {1: 8.7, 3: 5.2, 10: 1.7}
"""Theoretical ENR [dB] for Pd 0.5 at 2e-4 false identities per hour and code, by number of
bursts."""
PULSE_THEN_GAPS_DB = 11.6
"""ENR [dB] for Pd 0.5 if each pulse is detected by itself and then the gaps are compared."""
_SLACK_DB = 1.0
_BLOCK = 655
_GAP_SLOP_S = 1.5e-3
_PULSE_LEVEL = 8.0
"""Energy, in noise energies, of a pulse that is detected by itself. Noise gives 1.9 such pulses
a second in the window, and these give 2e-4 false identities an hour at a total gap tolerance of
1.5 ms."""
_RAISED = 1.0
"""Allowed false identities per hour and code in runs that count them; at 1e-4 none would
occur."""


def some_codes(rng: np.random.Generator, count: int) -> list[Tag]:
    """Typical codes: gaps of 18 to 75 ms, all at least 4 ms apart."""
    tags: list[Tag] = []
    while len(tags) < count:
        gaps_s = tuple(float(round(gap, 4)) for gap in rng.uniform(0.018, 0.075, 3))
        near = (sum(abs(a - b) for a, b in zip(gaps_s, t.gaps_s, strict=True)) for t in tags)
        if min(near, default=1.0) < 4e-3:
            continue
        tags.append(
            Tag(
                tag_id=len(tags) + 1,
                frequency_hz=166_380_000.0,
                pulse_width_s=0.0025,
                pulse_intervals_s=(float(round(rng.uniform(4.5, 6.0), 2)),),
                interval_uncertainty_s=0.004,
                k=10,
                gaps_s=gaps_s,
            )
        )
    return tags


def add_burst(
    samples: NDArray[np.complex64],
    tag: Tag,
    *,
    start_s: float,
    offset_hz: float,
    enr_db: float,
    stretch: float,
    rng: np.random.Generator,
    sample_rate_hz: float = RATE_HZ,
) -> None:
    """Add a burst in place, its gaps stretched by a relative amount."""
    at_s = start_s
    for gap_s in (0.0, *tag.gaps_s):
        at_s += gap_s * (1.0 + stretch)
        add_pulse(
            samples,
            TruePulse(start_s=at_s, offset_hz=offset_hz, enr_db=enr_db),
            sample_rate_hz=sample_rate_hz,
            width_s=tag.pulse_width_s,
            phase=rng.uniform(0.0, 2.0 * np.pi),
        )


def find(
    tags: Sequence[Tag],
    samples: NDArray[np.complex64],
    sample_rate_hz: float = RATE_HZ,
    *,
    false_per_hour: float = 1e-4,
) -> list[Pulse]:
    """Search samples of a channel for codes."""
    detector = CodedDetector(
        tags,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=tags[0].frequency_hz,
        frequency_window_hz=WINDOW_HZ,
        false_per_hour=false_per_hour,
    )
    found: list[Pulse] = []
    for first in range(0, len(samples), _BLOCK):
        time_ns = START_NS + ns_from_s(first / sample_rate_hz)
        found += detector.process(samples[first : first + _BLOCK], time_ns)
    return found + detector.flush()


def pulse_then_gaps(tag: Tag, samples: NDArray[np.complex64]) -> bool:
    """True if a code is found the usual way: by single pulses and then their gaps."""
    cells = Cells(
        sample_rate_hz=RATE_HZ,
        pulse_width_s=tag.pulse_width_s,
        low_hz=-WINDOW_HZ,
        high_hz=WINDOW_HZ,
        kept_s=1.0,
        recent_s=len(samples) / RATE_HZ,
    )
    cells.push(samples)
    best = cells.recent.max(axis=0)
    reach = cells.pulse // 2
    padded = np.pad(best, reach)
    tall = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    pulses_s = np.flatnonzero((best >= _PULSE_LEVEL) & (best == tall)) * cells.column_s
    for first_s in pulses_s:
        slop_s, at_s = 0.0, first_s
        for gap_s in tag.gaps_s:
            off_s = pulses_s - (at_s + gap_s)
            nearest = int(np.abs(off_s).argmin())
            slop_s += abs(float(off_s[nearest]))
            at_s = pulses_s[nearest]
        if slop_s <= _GAP_SLOP_S:
            return True
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """Detection of bursts of one strength by two methods."""

    enr_db: float
    matched: bool
    """True if our detector found the code."""
    by_pulses: bool
    """True if single pulses and their gaps found the code, in any of the bursts."""


def hear(rng: np.random.Generator, bursts: int, enr_db: float) -> Heard:
    """Simulate several bursts of a random code, with its own crystal error, and
    search for it.
    """
    (tag,) = some_codes(rng, 1)
    off_s = rng.uniform(-0.5, 0.5) * tag.interval_uncertainty_s
    interval_s = tag.pulse_intervals_s[0] + off_s
    stretch = rng.uniform(-0.5, 0.5) * _GAP_SLOP_S / sum(tag.gaps_s)
    samples = noise(rng, round((3.5 + (bursts - 1) * interval_s) * RATE_HZ))
    offset_hz = rng.uniform(-WINDOW_HZ, WINDOW_HZ)
    for number in range(bursts):
        add_burst(
            *(samples, tag),
            start_s=2.0 + rng.uniform(0.0, 1e-3) * (not number) + number * interval_s,
            offset_hz=offset_hz,
            enr_db=enr_db,
            stretch=stretch,
            rng=rng,
        )
    found = find([tag], samples)
    return Heard(
        enr_db=enr_db,
        matched=any(pulse.confirmed for pulse in found),
        by_pulses=pulse_then_gaps(tag, samples),
    )


def _rows(bursts: int) -> Callable[[Sequence[Heard]], list[Row]]:
    def rows(outcomes: Sequence[Heard]) -> list[Row]:
        words = f"{bursts} burst{'s' if bursts > 1 else ''}"
        matched: list[Shot] = [(one.enr_db, one.matched) for one in outcomes]
        by_pulses: list[Shot] = [(one.enr_db, one.by_pulses) for one in outcomes]
        found = [
            level_row(
                matched,
                experiment="E23",
                case=f"{words}, matched",
                most=THEORY_DB[bursts] + _SLACK_DB,
                union=THEORY_DB[bursts],
            )
        ]
        if bursts == 1:
            case = "1 burst, pulses, then gaps"
            found.append(
                level_row(by_pulses, experiment="E23", case=case, union=PULSE_THEN_GAPS_DB)
            )
        return found

    return rows


def _curve(bursts: int, levels_db: tuple[float, ...], per_level: int, seconds: float) -> Case:
    def trial(rng: np.random.Generator, index: int) -> Heard:
        return hear(rng, bursts, levels_db[index % len(levels_db)])

    above_db = THEORY_DB[bursts] + _SLACK_DB + 1.5

    def clearly(outcomes: Sequence[Heard]) -> list[Row]:
        share = sum(one.matched for one in outcomes) / len(outcomes)
        case = f"{bursts} of {above_db:g} dB, matched"
        return [Row.counted("E23", "Pd", case, share, len(outcomes), least=0.6)]

    count = {1: 12, 3: 4, 10: 3}[bursts]
    short = Case(
        name=f"{bursts}, in short",
        trials=count,
        least=count,
        seconds=seconds,
        trial=lambda rng, _: hear(rng, bursts, above_db),
        rows=clearly,
    )
    return Case(
        name=f"{bursts} bursts",
        trials=per_level * len(levels_db),
        least=4 * len(levels_db),
        seconds=seconds,
        trial=trial,
        rows=_rows(bursts),
        short=short,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistaken:
    """Count of false identities in a stretch."""

    code_hours: float
    wrong: int
    """Tags that were reported but did not send, each counted once."""


def mistake(
    rng: np.random.Generator,
    *,
    strong_db: float | None,
    seconds: float,
    nominal: float | None = None,
    listed: bool = True,
    unlisted: bool = True,
) -> Mistaken:
    """Search noise for 50 codes, optionally with a listed and an unlisted tag in it.

    `strong_db`: level of the tags that send; None for noise alone.
    `nominal`: allowed false identities per hour and code, instead of the case's default.
    `listed`, `unlisted`: True if that tag sends.
    """
    tags = some_codes(rng, 51)
    samples = noise(rng, round(seconds * RATE_HZ))
    senders: list[Tag] = []
    if strong_db is not None:
        senders = [*tags[:1]] * listed + [*tags[50:]] * unlisted
        for sender in senders:
            at_s, offset_hz = rng.uniform(0.0, 5.0), rng.uniform(-WINDOW_HZ, WINDOW_HZ)
            while at_s + sender.length_s < seconds:
                add_burst(
                    *(samples, sender),
                    start_s=at_s,
                    offset_hz=offset_hz,
                    enr_db=strong_db,
                    stretch=0.0,
                    rng=rng,
                )
                at_s += sender.pulse_intervals_s[0]
    if nominal is None:
        nominal = _RAISED if strong_db is None else 1e-4
    found = find(tags[:50], samples, false_per_hour=nominal)
    wrong = {one.tag_id for one in found if one.confirmed} - {one.tag_id for one in senders}
    return Mistaken(code_hours=50.0 * seconds / 3600.0, wrong=len(wrong))


def _mistakes(
    name: str, quantity: str, most: float, *, over: float
) -> Callable[..., list[Row]]:
    def rows(outcomes: Sequence[Mistaken]) -> list[Row]:
        hours = sum(one.code_hours for one in outcomes) * over
        wrong = [one.wrong for one in outcomes]
        low, high = count_interval(wrong)
        figure = sum(wrong) / hours
        # What would show a bar so low takes hours beyond an experiment.
        shown = high / hours <= most or figure > most or most * hours > 1.0
        note = f"at most {high / hours:.3f}; see the power law of `benchmarks coded`"
        return [
            Row.with_interval(
                "E23",
                quantity,
                name,
                (figure, low / hours, high / hours),
                round(sum(one.code_hours for one in outcomes)),
                most=most,
                shown=shown,
                note="" if shown else note,
            )
        ]

    return rows


def _false(name: str, strong_db: float | None, stretch_s: float, trials: int) -> Case:
    quantity = "false identities over nominal" if strong_db is None else "wrong, 1/(h code)"
    over = _RAISED if strong_db is None else 1.0
    most = 1.0 if strong_db is None else 1e-4

    def trial(rng: np.random.Generator, _index: int) -> Mistaken:
        return mistake(rng, strong_db=strong_db, seconds=stretch_s)

    def nearly(outcomes: Sequence[Mistaken]) -> list[Row]:
        wrong = sum(one.wrong for one in outcomes)
        return [Row.counted("E23", "false identities", name, wrong, len(outcomes), most=6.0)]

    short = Case(
        name=f"{name}, in short",
        trials=1,
        least=1,
        seconds=0.5,
        trial=lambda rng, _: mistake(rng, strong_db=strong_db, seconds=30.0),
        rows=nearly,
    )
    return Case(
        name=name,
        trials=trials,
        least=2,
        seconds=stretch_s / 50.0,
        trial=trial,
        rows=_mistakes(name, quantity, most, over=over),
        short=short,
    )


def _cost(seconds: float) -> Case:
    def trial(rng: np.random.Generator, _index: int) -> float:
        tags = some_codes(rng, 500)
        samples = noise(rng, round(seconds * RATE_HZ))
        begun_s = cpu_s()
        find(tags, samples)
        return (cpu_s() - begun_s) / seconds

    def rows(outcomes: Sequence[float]) -> list[Row]:
        share = 100.0 * min(outcomes)
        return [Row.counted("E23", "% of a core", "500 codes", share, len(outcomes), most=10.0)]

    return Case(
        name="500 codes",
        trials=3,
        least=1,
        seconds=0.1 * seconds,
        trial=trial,
        rows=rows,
        alone=True,
    )


E23 = Experiment(
    name="E23",
    title="bursts of coded tags",
    cases=(
        _curve(1, (8.0, 9.0, 10.0, 11.0, 12.0), 300, 0.02),
        _curve(3, (4.7, 5.7, 6.7), 200, 0.06),
        _curve(10, (1.7, 2.7, 3.7), 100, 0.2),
        _false("50 codes in noise", None, 200.0, 60),
        _false("50 codes, two tags at 30 dB", 30.0, 200.0, 60),
        _cost(60.0),
    ),
)
