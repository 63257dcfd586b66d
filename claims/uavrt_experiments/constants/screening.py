"""Screening of constants in groups, and singly in the groups that matter.

All constants of a group are multiplied by 0.7 and by 1.3. The judges that use one of them run
with common random numbers, and the differences are paired trial by trial.
"""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt_experiments.constants.changes import TUNED, change, constants, watch, watch_prior

_Floats = NDArray[np.float64]
MODULE = "uavrt_experiments.constants.screening"
FACTORS = (0.7, 1.3)
LEAST_SHARE, LEAST_RATIO, LEAST_NATS = 0.02, 0.05, 0.1
"""Smallest difference that counts: of a share, of a median relative to it, and of a mean."""
_RESAMPLES = 400
_PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "LEVELS": {
        "LEVELS, path loss": ("exponent", "exponent_sigma"),
        "LEVELS, scatter": ("shadowing_db", "fading_db"),
        "LEVELS, pulses by chance": ("outlier_share", "any_strength_db"),
    },
    "FLIGHT": {
        "FLIGHT, angles of turns": ("least_turn_deg", "whole_turn_deg"),
        "FLIGHT, errors of headings": ("own_heading_sigma_deg", "unknown_noise_sigma_deg"),
        "FLIGHT, error of positions": ("place_sigma_m",),
    },
    "TURNS": {
        "TURNS, hovering": ("window_s", "speed_m_s", "least_rate_deg_s"),
        "TURNS, flown path": (
            "path_window_s",
            "window_shift_m",
            "drift_span_deg",
            "radius_m",
        ),
        "TURNS, height": ("height_error_m",),
    },
    "COMMON": {
        "COMMON, wrong compass": ("wrong_compass_share", "wrong_compass_deg"),
        "COMMON, walk": ("walking_share", "walking_m_s"),
    },
    "LOSS": {
        "LOSS, hills": ("hills.mean", "hills.sigma", "hills.correlation_m"),
        "LOSS, shadowing": ("shadowing.sigma", "shadowing.correlation_m"),
    },
    "TRACK": {
        "TRACK, clutter": ("unheard_nats", "decay_nats", "lost_nats"),
        "TRACK, paths": ("end_m", "end_m_s", "fading_factor", "turning_m_s_per_root_s"),
    },
    "TagPrior": {
        "TagPrior, level": ("level_db", "level_sigma_db", "exponent", "shadowing_db"),
    },
    "ENERGY": {"ENERGY, noise": ("level_s", "level_rows")},
    "SEARCH": {
        "SEARCH, number of trials": (
            "hypotheses",
            "burst_hypotheses",
            "drift_independent_slots",
        ),
        "SEARCH, strong pulses": (
            "loud_hypotheses",
            "same_marks_share",
            "middle_weight",
        ),
        "SEARCH, other trains": ("explains_log", "same_ratio"),
        "SEARCH, several flights": (
            "stretch",
            "least_cells",
            "stretch_hypotheses",
            "place_hypotheses",
        ),
    },
    "PLACE": {
        "PLACE, counted evidence": ("counted", "lasting_db2", "noisy_db2"),
        "PLACE, fading": ("more_fading_log", "odd_fading_db"),
        "PLACE, reported position": ("density_power", "alone"),
        "PLACE, rates": ("rate_change", "stray_share", "noise_share"),
    },
}
"""Related constants of large records, by the name of their group."""
Outcomes = dict[str, list[dict[str, float]]]
"""Figures of each trial by judge."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """Difference of a figure by a change of constants, with its standard error."""

    judge: str
    quantity: str
    factor: float
    before: float
    after: float
    error: float
    size: float
    """Difference in units of the smallest that counts."""

    @property
    def clear(self) -> bool:
        """True if the difference exceeds two standard errors."""
        return abs(self.after - self.before) > 2.0 * self.error

    def __str__(self) -> str:
        return (
            f"× {self.factor:g}: {self.judge}: {self.quantity} {self.before:.3g} → "
            f"{self.after:.3g} (± {self.error:.2g})"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """Effects of changing some constants together."""

    name: str
    constants: tuple[str, ...]
    judges: int
    """Number of judges that use one of the constants."""
    effects: tuple[Effect, ...]

    @property
    def matters(self) -> bool:
        """True if a figure changes by more than its error and by an amount that counts."""
        return any(one.clear and one.size >= 1.0 for one in self.effects)

    @property
    def verdict(self) -> str:
        """Whether the constants change a figure."""
        if not self.judges:
            return "not screened"
        if self.matters:
            return "matters"
        if any(one.size >= 1.0 for one in self.effects):
            return "not resolved"
        return "changes little" if any(one.clear for one in self.effects) else "moves nothing"

    def largest(self, count: int = 1) -> list[Effect]:
        """Largest clear effects, or the largest of all if none is clear."""
        some = [one for one in self.effects if one.clear] or list(self.effects)
        return sorted(some, key=lambda one: -one.size)[:count]


def groups() -> dict[str, tuple[str, ...]]:
    """Tuned constants of each record, or of each related part of a large record."""
    found: dict[str, tuple[str, ...]] = {}
    for path, kind in constants().items():
        if kind == TUNED:
            record, _, field = path.partition(".")
            parts = _PARTS.get(record, {record: ()})
            name = next((name for name, own in parts.items() if field in own), None)
            name = name or (f"{record}, others" if record in _PARTS else record)
            found[name] = (*found.get(name, ()), path)
    return found


def chosen(names: Sequence[str] | None, *, singly: bool) -> dict[str, tuple[str, ...]]:
    """Groups that are named by group, record or constant, or their constants one by one."""
    found: dict[str, tuple[str, ...]] = {}
    for group, paths in groups().items():
        for path in paths:
            if names is None or {group, path, path.partition(".")[0]} & {*names}:
                alone = singly or (names is not None and path in names)
                name = path if alone else group
                found[name] = (*found.get(name, ()), path)
    return found


def outcomes(
    paths: Sequence[str], factor: float, judges: Sequence[str], runs: int, seed: int
) -> tuple[Outcomes, dict[str, list[str]]]:
    """Trials of judges with changed constants, and without a change the constants they use.

    `judges`: names of judges, or their beginnings; all if empty.

    Call once in a process, before the estimators are imported.
    """
    reads: set[str] = set()
    if not paths:
        watch(reads)
    change(paths, factor)
    from uavrt_experiments.constants.judges import JUDGES

    if not paths:
        watch_prior(reads)
    early = set(reads)
    flown: Outcomes = {}
    used = {}
    for number, (name, judge) in enumerate(JUDGES.items()):
        if judges and not name.startswith(tuple(judges)):
            continue
        reads.clear()
        count = max(2, round(judge.trials * runs / 100))
        flown[name] = [
            judge.fly(np.random.default_rng([seed, number, trial])) for trial in range(count)
        ]
        # What a module copied when it was imported counts if the judge uses that record.
        records = {one.partition(".")[0] for one in reads}
        used[name] = sorted(reads | {one for one in early if one.partition(".")[0] in records})
    return flown, used


def run(
    paths: Sequence[str], factor: float, judges: Sequence[str], runs: int, seed: int
) -> tuple[Outcomes, dict[str, list[str]]]:
    """Result of `outcomes` in a process of its own."""
    asked = json.dumps([list(paths), factor, list(judges), runs, seed])
    done = subprocess.run(
        [sys.executable, "-m", MODULE, asked], check=True, stdout=subprocess.PIPE
    )
    flown, used = json.loads(done.stdout)
    return flown, used


def effects(before: Outcomes, after: Outcomes, factor: float) -> Iterator[Effect]:
    """Paired differences of all figures that both have."""
    for judge, trials in after.items():
        pairs = list(zip(before[judge], trials, strict=True))
        for quantity in dict.fromkeys(name for one, _ in pairs for name in one):
            both = [
                (one[quantity], other[quantity])
                for one, other in pairs
                if quantity in one and quantity in other
            ]
            if len(both) > 1:
                yield _effect(judge, quantity, factor, np.array(both))


def _effect(judge: str, quantity: str, factor: float, pairs: _Floats) -> Effect:
    numeric = quantity.endswith(("[m]", "[°]"))
    figure: Callable[..., Any] = np.median if numeric else np.mean
    first, second = (float(one) for one in figure(pairs, axis=0))
    rng = np.random.default_rng(len(pairs))
    drawn = pairs[rng.integers(0, len(pairs), (_RESAMPLES, len(pairs)))]
    error = float(np.std(np.diff(figure(drawn, axis=1), axis=1)))
    least = LEAST_NATS if quantity.endswith("[nats]") else LEAST_SHARE
    if numeric:
        least = LEAST_RATIO * max(abs(first), 1e-9)
    return Effect(
        judge=judge,
        quantity=quantity,
        factor=factor,
        before=first,
        after=second,
        error=error,
        size=abs(second - first) / least,
    )


def screen(
    chosen: Mapping[str, Sequence[str]],
    runs: int,
    seed: int,
    *,
    judges: Sequence[str] = (),
    on_screened: Callable[[Screened], None] = lambda one: None,
) -> list[Screened]:
    """Screen groups of constants by name.

    `runs`: size of the judges; 100 take about two minutes of a core for each group.
    `judges`: names of the judges that run, or their beginnings; all if empty.
    """
    fly = partial(run, runs=runs, seed=seed)
    if not chosen:
        return []
    # Which judges use a constant is known only after they ran.
    before, used = fly((), 1.0, judges)
    screened = []
    for name, paths in chosen.items():
        # A part of a record counts as used if the record is.
        fields = {".".join(path.split(".")[:2]) for path in paths}
        own = [judge for judge, reads in used.items() if fields & {*reads}]
        found = [
            effect
            for factor in FACTORS
            if own
            for effect in effects(before, fly(paths, factor, own)[0], factor)
        ]
        screened.append(
            Screened(name=name, constants=tuple(paths), judges=len(own), effects=tuple(found))
        )
        on_screened(screened[-1])
    return screened


if __name__ == "__main__":
    # The estimators may not be imported before the constants are changed.
    sys.stdout.write(json.dumps(outcomes(*json.loads(sys.argv[1]))))
