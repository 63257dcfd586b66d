"""Many seeded trials on several processes, and the rows made of them.

A trial is a function of its own random generator, seeded by the campaign's seed, the case and
the trial's number: any number of processes gives the same rows.

600 trials begin with the 50 of the short run, so a surprise can be examined separately. The
figure decides if a requirement (bar) is met. If the bar is inside the 95 % interval, the
verdict says so; only bars outside it make the command fail.
"""

import math
import multiprocessing
import os
import signal
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from uavrt_experiments.detection.cases import Case, Experiment
from uavrt_experiments.detection.catalogue import EXPERIMENTS
from uavrt_experiments.result import Row

_CHUNK_S = 3.0
"""CPU time of one chunk of trials [s]: much shorter than the campaign, much longer than sending
it."""
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Consecutive trials of a case, identified by names, because a case itself cannot be
    pickled.
    """

    experiment: str
    case: int
    first: int
    last: int
    seed: int


_SHORT_S = 0.6
"""CPU time of a case's short form, if one trial takes no longer [s]."""


def short_rows(case: Case, seed: int) -> list[Row]:
    """Run a case's short form, which detects gross misses of a bar in a second of CPU time.

    Unless the case defines another form, it is a few of its own trials.
    """
    brief = case.short or case
    count = brief.least if case.short else min(case.least, int(_SHORT_S / case.seconds))
    name = zlib.crc32(case.name.encode())
    return brief.rows(
        [
            brief.trial(np.random.default_rng((seed, name, index)), index)
            for index in range(max(1, count))
        ]
    )


def run_chunk(chunk: Chunk) -> list[Any]:
    """Run a chunk's trials in the calling process."""
    case = EXPERIMENTS[chunk.experiment].cases[chunk.case]
    name = zlib.crc32(f"{chunk.experiment} {case.name}".encode())
    return [
        case.trial(np.random.default_rng((chunk.seed, name, index)), index)
        for index in range(chunk.first, chunk.last)
    ]


def run_experiments(
    experiments: Iterable[Experiment],
    *,
    trials: int,
    seed: int,
    workers: int = 1,
    case: str = "",
    on_progress: Callable[[float, str], None] = lambda part, what: None,
) -> list[Row]:
    """Run experiments and make their rows, in the order of the experiments.

    `trials`: decisions for each point of a Pd curve; everything else in proportion.
    `workers`: number of processes; 1: only this one.
    `case`: only cases with this in their names.
    `on_progress`: receives the share done, by expected CPU time, and the name of the last case.
    """
    chosen = list(experiments)
    cases = {
        (e.name, i): one for e in chosen for i, one in enumerate(e.cases) if case in one.name
    }
    every = [c for e in chosen for c in _chunks(e, trials, seed)]
    chunks = [c for c in every if (c.experiment, c.case) in cases]
    weights = {
        chunk: (chunk.last - chunk.first) * cases[chunk.experiment, chunk.case].seconds
        for chunk in chunks
    }
    total = sum(weights.values()) or 1.0
    outcomes: dict[Chunk, list[Any]] = {}
    done = 0.0

    def take(chunk: Chunk, outcome: list[Any]) -> None:
        nonlocal done
        outcomes[chunk] = outcome
        done += weights[chunk]
        name = cases[chunk.experiment, chunk.case].name
        on_progress(done / total, f"{chunk.experiment} {name}")

    together = [c for c in chunks if not cases[c.experiment, c.case].alone]
    if workers > 1:
        # The longest first: no process is left alone with one at the end.
        _in_processes(sorted(together, key=lambda c: -weights[c]), workers, take)
    else:
        for chunk in together:
            take(chunk, run_chunk(chunk))
    for chunk in chunks:
        if chunk not in outcomes:
            take(chunk, run_chunk(chunk))
    rows: list[Row] = []
    for key, one in cases.items():
        mine = [c for c in chunks if (c.experiment, c.case) == key]
        rows += one.rows([outcome for chunk in mine for outcome in outcomes[chunk]])
    return rows


def _chunks(experiment: Experiment, trials: int, seed: int) -> list[Chunk]:
    chunks = []
    for number, case in enumerate(experiment.cases):
        count = case.count(trials)
        size = max(1, math.floor(_CHUNK_S / case.seconds))
        chunks += [
            Chunk(
                experiment=experiment.name,
                case=number,
                first=first,
                last=min(first + size, count),
                seed=seed,
            )
            for first in range(0, count, size)
        ]
    return chunks


def _in_processes(
    chunks: Sequence[Chunk], workers: int, take: Callable[[Chunk, list[Any]], None]
) -> None:
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        try:
            with _ctrl_c_ignored():  # by the workers, who inherit it: we alone end them
                pending = {pool.submit(run_chunk, chunk): chunk for chunk in chunks}
            for future in as_completed(pending):
                take(pending[future], future.result())
        except BaseException:
            working = multiprocessing.active_children()
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in working:  # a chunk takes minutes
                worker.terminate()
            raise
        finally:
            signal.signal(signal.SIGTERM, before)


@contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
