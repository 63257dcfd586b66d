"""Whole bands with beepers and interference, and the results of the search for beeps.

``python -m uavrt_experiments.detection.beeping five 60`` measures five unknown tags at 3 MS/s
among carriers, FM voice and impulses; ``ghosts HOURS RATE`` counts false trains without
beepers.
"""

import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.measure_tag import Measurement, measure_tags
from uavrt.config.ghost_places import Receiver
from uavrt.core.messages import Beep, BeepKind, IQBlock, Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.beeps.beep_points import PointSearch
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.detection.beeps.beep_trains import Train, find_trains
from uavrt.dsp.frontend import FrontEnd
from uavrt_experiments.detection.signals import START_NS, THESIS_TAG

CENTER_HZ = 148_700_000.0
CODE_GAPS_S = (0.022, 0.0488, 0.0366)
_BLOCK = 1 << 17
_AUDIO_HZ = 8000.0
_MINUTE_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Beeper:
    """A tag that sends for the whole time of a scene."""

    offset_hz: float
    enr_db: float
    width_s: float
    starts_s: NDArray[np.float64]


def regular(
    duration_s: float, interval_s: float, first_s: float, *, drift: float = 0.0
) -> NDArray[np.float64]:
    """Start times of pulses whose interval grows by the relative amount `drift` over the
    duration.
    """
    number = np.arange(int(duration_s / interval_s) + 2)
    grown = 0.5 * drift * interval_s / duration_s * number**2
    starts_s = first_s + interval_s * (number + grown)
    return np.asarray(starts_s[starts_s < duration_s - 0.2])


def five_tags(duration_s: float, rate_hz: float) -> tuple[Beeper, ...]:
    """Five tags with intervals of 0.9 to 2.2 s and pulses of 8 to 30 ms: one drifts, one has
    two rates, one is coded.
    """
    slow = regular(duration_s / 2.0, 1.333, 0.7)
    fast = slow[-1] + 2.0 + regular(duration_s - slow[-1] - 2.0, 2.0, 0.0)
    bursts = regular(duration_s, 5.3, 0.9)
    code = np.concatenate(([0.0], np.cumsum(CODE_GAPS_S)))
    drifting = regular(duration_s, 1.254, 0.4, drift=20e-6)
    return (
        Beeper(
            offset_hz=-0.27 * rate_hz + 305.0, enr_db=24.0, width_s=0.020, starts_s=drifting
        ),
        Beeper(
            offset_hz=-0.077 * rate_hz + 674.0,
            enr_db=26.0,
            width_s=0.008,
            starts_s=regular(duration_s, 0.9, 0.5),
        ),
        Beeper(
            offset_hz=0.0137 * rate_hz,
            enr_db=24.0,
            width_s=0.015,
            starts_s=np.concatenate((slow, fast)),
        ),
        Beeper(
            offset_hz=0.24 * rate_hz,
            enr_db=26.0,
            width_s=0.0025,
            starts_s=(bursts[:, None] + code).ravel(),
        ),
        Beeper(
            offset_hz=0.368 * rate_hz + 2.0,
            enr_db=22.0,
            width_s=0.030,
            starts_s=regular(duration_s, 2.2, 0.3),
        ),
    )


@dataclass(slots=True, kw_only=True)
class Scene:
    """A sample source with noise of unit power, beepers and interference.

    Levels of interference are over the noise in 100 Hz [dB].
    """

    duration_s: float
    sample_rate_hz: float
    seed: int = 1
    beepers: Sequence[Beeper] = ()
    carriers_db: Sequence[float] = ()
    voice_db: float | None = None
    """Level of FM voice (2.5 kHz of deviation, with syllables and pauses) [dB];
    None: no voice."""
    data_db: float | None = None
    """Level of four-level data in slots of 30 ms, of which every second is empty [dB]; None: no
    data."""
    impulses_per_s: float = 0.0
    mains_db: float = 0.0
    """Rise of the noise in a fifth of each hundredth of a second [dB]."""
    center_frequency_hz: float = CENTER_HZ
    generating_s: float = 0.0
    """Processor time used to make the samples [s]."""
    _at: int = 0
    _table: NDArray[np.complex64] | None = None
    _phases: dict[str, tuple[int, NDArray[np.float64]]] = field(default_factory=dict)

    @property
    def total_samples(self) -> int:
        """Length [samples]."""
        return round(self.duration_s * self.sample_rate_hz)

    def close(self) -> None:
        """Do nothing; a scene has nothing to close."""

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Make the next block."""
        begun_s = time.process_time()
        first, rate_hz = self._at, self.sample_rate_hz
        count = min(_BLOCK, self.total_samples - first)
        if count <= 0:
            raise EOFError
        rng = np.random.default_rng((self.seed, first))
        samples = rng.standard_normal((count, 2), dtype=np.float32).view(np.complex64).ravel()
        samples *= np.float32(math.sqrt(0.5))
        at = np.arange(first, first + count)
        if self.mains_db:
            loud = (at * (100.0 / rate_hz)) % 1.0 < 0.2
            samples[loud] *= np.float32(10.0 ** (self.mains_db / 20.0))
        if self.carriers_db:
            samples += self._carriers()[:count]
        if self.voice_db is not None:
            phase = self._phase("voice", at)
            samples += self._wave(at, 0.2, self.voice_db, phase)
        if self.data_db is not None:
            on = (at * (1.0 / (0.06 * rate_hz))) % 1.0 < 0.5
            wave = self._wave(at, -0.4, self.data_db, self._phase("data", at))
            samples += np.where(on, wave, np.complex64(0.0))
        width = max(1, round(20e-6 * rate_hz))
        for _ in range(rng.poisson(self.impulses_per_s * count / rate_hz)):
            place = int(rng.integers(0, max(1, count - width)))
            spike = rng.standard_normal((width, 2), dtype=np.float32).view(np.complex64)
            samples[place : place + width] += np.float32(30.0) * spike.ravel()
        for beeper in self.beepers:
            self._add(samples, first, beeper)
        self._at = first + count
        self.generating_s += time.process_time() - begun_s
        time_ns = START_NS + ns_from_s(first / rate_hz)
        return IQBlock(samples, first, time_ns, rate_hz)

    def _add(self, samples: NDArray[np.complex64], first: int, beeper: Beeper) -> None:
        rate_hz = self.sample_rate_hz
        amplitude = math.sqrt(10.0 ** (beeper.enr_db / 10.0) / (beeper.width_s * rate_hz))
        begin_s, end_s = first / rate_hz, (first + len(samples)) / rate_hz
        low, high = np.searchsorted(beeper.starts_s, (begin_s - beeper.width_s, end_s))
        for start_s in beeper.starts_s[low:high]:
            at = np.arange(
                max(first, math.ceil(start_s * rate_hz)),
                min(first + len(samples), math.floor((start_s + beeper.width_s) * rate_hz) + 1),
            )
            cycles = (at * (beeper.offset_hz / rate_hz)) % 1.0
            samples[at - first] += (amplitude * np.exp(2j * np.pi * cycles)).astype(
                np.complex64
            )

    def _amplitude(self, level_db: float) -> float:
        return math.sqrt(10.0 ** (level_db / 10.0) * 100.0 / self.sample_rate_hz)

    def _carriers(self) -> NDArray[np.complex64]:
        """Sum of the carriers over a block, which contains whole cycles of each."""
        if self._table is None:
            at = np.arange(_BLOCK)
            total = np.zeros(_BLOCK, np.complex128)
            places = np.linspace(-0.31, 0.27, len(self.carriers_db))
            for place, level_db in zip(places, self.carriers_db, strict=True):
                cycles = round(place * _BLOCK) / _BLOCK * at
                total += self._amplitude(level_db) * np.exp(2j * np.pi * (cycles % 1.0))
            self._table = total.astype(np.complex64)
        return self._table

    def _wave(
        self, at: NDArray[np.int64], place: float, level_db: float, phase: NDArray[np.float64]
    ) -> NDArray[np.complex64]:
        angle = (2.0 * np.pi * ((at * place + phase) % 1.0)).astype(np.float32)
        wave = np.empty(at.size, np.complex64)
        amplitude = np.float32(self._amplitude(level_db))
        wave.real, wave.imag = amplitude * np.cos(angle), amplitude * np.sin(angle)
        return wave

    def _phase(self, kind: str, at: NDArray[np.int64]) -> NDArray[np.float64]:
        """Phase of a modulated signal about its centre [cycles], made a minute at a time."""
        minute = int(at[0] / self.sample_rate_hz // _MINUTE_S)
        known = self._phases.get(kind)
        if known is None or known[0] != minute:
            rng = np.random.default_rng((self.seed, minute, len(kind)))
            count = round((_MINUTE_S + 2.0) * _AUDIO_HZ)
            made_hz = _voice_hz(rng, count) if kind == "voice" else _data_hz(rng, count)
            known = minute, np.cumsum(made_hz) / _AUDIO_HZ
            self._phases[kind] = known
        inside = (at / self.sample_rate_hz - minute * _MINUTE_S) * _AUDIO_HZ
        return np.interp(inside, np.arange(known[1].size), known[1])


def _voice_hz(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Frequency of FM voice about its centre [Hz]: noise of 300 to 3000 Hz in syllables."""
    frequencies = np.fft.rfftfreq(count, 1.0 / _AUDIO_HZ)
    sound = np.fft.rfft(rng.standard_normal(count))
    sound *= ((frequencies > 300.0) & (frequencies < 3000.0)) / np.maximum(frequencies, 300.0)
    slow = np.fft.rfft(rng.standard_normal(count)) * (frequencies < 4.0)
    voice, loudness = np.fft.irfft(sound, count), np.fft.irfft(slow, count)
    return np.asarray(
        1500.0 * voice / voice.std() * np.clip(loudness / loudness.std(), 0.0, None)
    )


def _data_hz(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Frequency of four-level data of 4000 symbols a second about its centre [Hz]."""
    symbols = rng.integers(0, 4, count // 2 + 1)
    return np.repeat(1296.0 * symbols - 1944.0, 2)[:count]


@dataclass(frozen=True, slots=True, kw_only=True)
class FiveResult:
    """Result of `uavrt tags measure` for five unknown tags."""

    right: int
    wrong: tuple[str, ...]
    doubtful: tuple[str, ...]
    cpu_share: float
    """Processor time over the duration, without the time to make the samples."""


def five(
    duration_s: float, rate_hz: float, *, seed: int = 1, interference: bool = True
) -> FiveResult:
    """Measure five unknown tags among four carriers, FM voice and three impulses a second."""
    tags = five_tags(duration_s, rate_hz)
    scenes: list[Scene] = []

    def opened() -> Scene:
        scene = Scene(
            duration_s=duration_s,
            sample_rate_hz=rate_hz,
            seed=seed,
            beepers=tags,
            carriers_db=(30.0, 45.0, 20.0, 60.0) if interference else (),
            voice_db=45.0 if interference else None,
            impulses_per_s=3.0 if interference else 0.0,
        )
        scenes.append(scene)
        return scene

    begun_s = time.process_time()
    measurement = measure_tags(opened)
    spent_s = time.process_time() - begun_s - sum(one.generating_s for one in scenes)
    right, wrong = _compare(measurement, tags)
    return FiveResult(
        right=right,
        wrong=tuple(wrong),
        doubtful=tuple(str(one) for one in measurement.doubtful),
        cpu_share=spent_s / duration_s,
    )


def _compare(measurement: Measurement, tags: Sequence[Beeper]) -> tuple[int, list[str]]:
    """Count the tags whose values are all right; describe the other trains."""
    intervals_s = ((1.254,), (0.9,), (1.333, 2.0), (5.3,), (2.2,))
    right, wrong = 0, []
    left = dict(enumerate(tags))
    for one in measurement.tags:
        found_s = sorted(rate.interval_s for rate in one.rates)
        for number, tag in left.items():
            if (
                abs(one.frequency_hz - CENTER_HZ - tag.offset_hz) < 5.0
                and len(found_s) == len(intervals_s[number])
                and np.allclose(found_s, intervals_s[number], rtol=1e-4)
                and abs(one.pulse_width_s - tag.width_s) < 1e-3
            ):
                right += 1
                del left[number]
                break
        else:
            wrong.append(f"{one.frequency_hz - CENTER_HZ:.0f} Hz, {found_s}")
    for code in measurement.codes:
        tag = tags[3]
        if (
            abs(code.frequency_hz - CENTER_HZ - tag.offset_hz) < 60.0
            and np.allclose(code.gaps_s, CODE_GAPS_S, atol=3e-4)
            and abs(code.burst_interval_s - 5.3) < 1e-3
            and left.pop(3, None) is not None
        ):
            right += 1
        else:
            wrong.append(f"{code.frequency_hz - CENTER_HZ:.0f} Hz, gaps {code.gaps_s}")
    return right, wrong


def ghosts(
    hours: float, rate_hz: float, *, seed: int = 1, at_once_s: float = 600.0
) -> dict[str, list[Train]]:
    """Search bands without beepers, ten minutes at a time; every train found is false."""
    kinds: dict[str, Callable[[Scene], None]] = {
        "noise": lambda scene: None,
        "impulses": lambda scene: setattr(scene, "impulses_per_s", 8.0),
        "voice": lambda scene: setattr(scene, "voice_db", 45.0),
        "data": lambda scene: setattr(scene, "data_db", 45.0),
        "mains bursts": lambda scene: setattr(scene, "mains_db", 12.0),
    }
    found: dict[str, list[Train]] = {}
    for kind, disturb in kinds.items():
        found[kind] = []
        for part in range(max(1, round(hours * 3600.0 / at_once_s / len(kinds)))):
            scene = Scene(duration_s=at_once_s, sample_rate_hz=rate_hz, seed=seed + 1000 * part)
            disturb(scene)
            found[kind] += trains_of(scene)
    return found


def blocks_of(scene: Scene) -> Iterator[IQBlock]:
    """Yield all blocks of a scene."""
    while True:
        try:
            block = scene.read()
        except EOFError:
            return
        if block is not None:
            yield block


def trains_of(scene: Scene) -> list[Train]:
    """Find the trains in a scene, relative to its centre."""
    rate_hz = scene.sample_rate_hz
    search = PointSearch(sample_rate_hz=rate_hz, low_hz=-rate_hz / 2, high_hz=rate_hz / 2)
    for block in blocks_of(scene):
        search.process(block.samples)
    return find_trains(search.finish(), scene.duration_s, Receiver(0.0, rate_hz))[0]


def named(scene: Scene, tags: Sequence[Tag], frequency_window_hz: float) -> list[Beep]:
    """Identify senders of pulses in a scene, as `uavrt detect` does."""
    return searched_blocks(blocks_of(scene), tags, frequency_window_hz)


def searched_blocks(
    blocks: Iterable[IQBlock], tags: Sequence[Tag], frequency_window_hz: float
) -> list[Beep]:
    """Identify senders of pulses in blocks that are the whole band."""
    search: BeepSearch | None = None
    for block in blocks:
        if search is None:
            radio = Receiver(CENTER_HZ, block.sample_rate_hz)
            search = BeepSearch(tags, frequency_window_hz, radio)
        search.add(block, block)
    assert search is not None
    return search.finish()


def names_right(tries: int, what: str, *, seed: int = 1) -> float:
    """Share of tags of 20 dB whose `offset` (frequency) or `rate` (interval) is identified.

    The offset is up to 1800 Hz, or up to 10 kHz in a `dongle`, and must be identified within 10
    intervals. The interval is 0.3 to 2.5 s and must be identified within 20 pulses.
    """
    right = 0
    reach_hz, rate_hz = (10e3, 48e3) if what == "dongle" else (1800.0, 24e3)
    for number in range(tries):
        rng = np.random.default_rng((seed, number))
        listed = replace(
            THESIS_TAG,
            frequency_hz=CENTER_HZ + rng.uniform(-8000.0, 8000.0),
            pulse_intervals_s=(rng.uniform(0.8, 2.0),),
        )
        interval_s, offset_hz, pulses = listed.pulse_intervals_s[0], 0.0, 10
        if what != "rate":
            offset_hz = float(rng.uniform(-reach_hz, reach_hz))
            interval_s += rng.uniform(-0.05, 0.05)
        else:
            pulses = 20
            while abs(interval_s - listed.pulse_intervals_s[0]) < 0.07:
                interval_s = rng.uniform(0.3, 2.5)
        duration_s = pulses * interval_s + 0.2
        starts_s = regular(duration_s, interval_s, rng.uniform(0.0, interval_s))
        beeper = Beeper(
            offset_hz=listed.frequency_hz - CENTER_HZ + offset_hz,
            enr_db=20.0,
            width_s=0.02,
            starts_s=starts_s + rng.uniform(0.0, 0.01, starts_s.size),
        )
        scene = Scene(
            duration_s=duration_s, sample_rate_hz=rate_hz, seed=seed + number, beepers=(beeper,)
        )
        found = named(scene, [listed], 500.0)
        if len(found) != 1:
            continue
        (one,) = found
        if what != "rate":
            inside = abs(offset_hz) <= 530.0
            near = one.away_hz is not None and abs(one.away_hz - offset_hz) < 15.0
            right += near and one.kind is (BeepKind.LISTED if inside else BeepKind.OFF_LABEL)
        else:
            same = abs(one.interval_s - interval_s) < 0.01
            right += same and one.kind is BeepKind.OTHER_RATE
    return right / tries


def named_live(rate_hz: float, duration_s: float, *, enr_db: float, seed: int) -> int:
    """Number of five unlisted beepers of 0.5 to 2 s that are identified while a stream runs.

    They are anywhere in the radio's band; the tags' band is a quarter of it, as in flight.
    """
    rng = np.random.default_rng(seed)
    beepers = tuple(
        Beeper(
            offset_hz=float(rng.uniform(-0.45, 0.45) * rate_hz),
            enr_db=enr_db,
            width_s=0.02,
            starts_s=regular(duration_s, float(rng.uniform(0.5, 2.0)), 0.3),
        )
        for _ in range(5)
    )
    scene = Scene(duration_s=duration_s, sample_rate_hz=rate_hz, seed=seed, beepers=beepers)
    search = BeepSearch((), 500.0, Receiver(CENTER_HZ, rate_hz), live=True)
    front_end = FrontEnd(
        sample_rate_hz=rate_hz, center_frequency_hz=CENTER_HZ, frequencies_hz=[CENTER_HZ + 5e3]
    )
    found: list[Beep] = []
    for block in blocks_of(scene):
        search.add(block, front_end.decimate(block))
        found += search.news(block.time_ns)
    return sum(
        any(abs(one.frequency_hz - CENTER_HZ - beeper.offset_hz) < 30.0 for one in found)
        for beeper in beepers
    )


def main(arguments: Sequence[str]) -> None:
    """Run one campaign and print its result."""
    kind, *values = arguments
    if kind == "five":
        duration_s, rate_hz = float(values[0]), float(values[1]) if values[1:] else 3e6
        for seed in range(1, 1 + (int(values[2]) if values[2:] else 1)):
            sys.stdout.write(f"{five(duration_s, rate_hz, seed=seed)}\n")
    elif kind == "named":
        for what in ("offset", "dongle", "rate"):
            sys.stdout.write(f"{what} {names_right(int(values[0]), what)}\n")
    elif kind == "live":
        for seed in range(1, 1 + int(values[0])):
            named_count = named_live(3e6, 50.0, enr_db=float(values[1]), seed=seed)
            sys.stdout.write(f"{named_count} of 5\n")
    else:
        found = ghosts(float(values[0]), float(values[1]))
        for name, trains in found.items():
            listed = [
                (round(one.frequency_hz), round(one.interval_s, 4), len(one.points), one.doubt)
                for one in trains
            ]
            sys.stdout.write(f"{name} {len(trains)} {json.dumps(listed)}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
