"""Experiments B1–B6: accuracy of bearings."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.random import Generator

from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.bearing.learned_pattern import TurnPulses, learn_pattern
from uavrt.localization.results import BearingMethod
from uavrt_experiments.figures import measured, median, rms, share
from uavrt_experiments.localization.rotations import (
    RotationCase,
    Trial,
    bound_deg,
    matched_power,
    trial,
)
from uavrt_experiments.result import Row

_OTHERS: tuple[BearingMethod, ...] = ("pca", "pearson", "ls_linear", "ls_db")


def known_phase(runs: int, seed: int) -> list[Row]:
    """B1 and B2: powers measured at the known time of every pulse; our method and the classic
    ones.
    """
    bars = {
        RotationCase(): 2.2,
        RotationCase(snr_db=30.0, fading_db=0.5): 0.62,
        RotationCase(snr_db=13.0): 3.8,
        RotationCase(fading_db=4.0): 3.4,
    }
    results = []
    for number, (case, most) in enumerate(bars.items()):
        name = "B2" if number else "B1"
        trials = _trials(runs, seed, partial(trial, case=case))
        results += _lines(name, case, trials, most)
        for method in _OTHERS if number == 0 else ():
            others = _trials(runs, seed, partial(trial, case=case, method=method))
            errors = [one.error_deg for one in others]
            condition = f"{case}: {method}"
            results.append(measured(name, condition, "rms [°]", errors, rms))
    return results


def censored(runs: int, seed: int) -> list[Row]:
    """B3 and B4: few pulses and strong fading; with a threshold, the requirement is that for
    misses.
    """
    bars = {20: 7.6, 30: 6.2, 60: 4.3}
    results = []
    for pulses, most in ((20, 6.6), (30, 5.3)):
        case = RotationCase(pulses=pulses, fading_db=4.0)
        results += _lines("B3", case, _trials(runs, seed, partial(trial, case=case)), most)
    for pulses, most in bars.items():
        for antenna in ("RA-23K", "RA-2A", "H3"):
            case = RotationCase(
                antenna=antenna, pulses=pulses, fading_db=4.0, threshold_db=10.0
            )
            bar = most if antenna == "RA-23K" else 1.4 * bound_deg(case)
            trials = _trials(runs, seed, partial(trial, case=case))
            results += _lines("B3", case, trials, bar)
    for threshold_db in (None, 10.0):
        case = RotationCase(pulses=8, fading_db=1.0, threshold_db=threshold_db)
        trials = _trials(runs, seed, partial(trial, case=case))
        results += _lines("B4", case, trials, 5.0 if threshold_db is None else 5.4)
    return results


def wrong_pattern(runs: int, seed: int) -> list[Row]:
    """B5: the antenna differs from its table by 1.5 dB rms; headings err by 3° and 0.2 s."""
    case = RotationCase()

    def run(rng: Generator) -> Trial:
        return trial(
            rng,
            case,
            pattern=disturbed(rng, PATTERNS[case.antenna], 1.5),
            yaw_jitter_deg=3.0,
            yaw_lag_deg=1.2,
        )

    trials = _trials(runs, seed, run)
    errors = [abs(one.error_deg) for one in trials]
    condition = f"{case}; pattern 1.5 dB, heading 3° and 0.2 s wrong"
    covered = [float(one.covered) for one in trials]
    rng = np.random.default_rng(seed)
    learnt = [abs(error_after_learning(rng, case)) for _ in range(max(2, runs // 5))]
    return [
        measured("B5", condition, "median [°]", errors, median, most=5.0),
        measured("B5", condition, "90 % interval holds", covered, share, least=0.85),
        measured("B5", f"{condition}, 5 turns learnt", "median [°]", learnt, median, most=3.0),
    ]


def error_after_learning(rng: Generator, case: RotationCase) -> float:
    """Error [deg] of a sixth turn whose pattern was learnt from five turns."""
    nominal = PATTERNS[case.antenna]
    true = disturbed(rng, nominal, 1.5)
    turns = []
    for bearing in rng.uniform(0.0, 360.0, 5):
        yaw = rng.uniform(0.0, 360.0) + np.arange(case.pulses) * 360.0 / case.pulses
        level = case.snr_db + true.gain_db(bearing - yaw)
        power = matched_power(rng, level + rng.normal(0.0, case.fading_db, case.pulses))
        heading = yaw + rng.normal(0.0, 3.0, case.pulses)
        turns.append(TurnPulses(yaw_deg=heading, matched_power=power))
    believed = learn_pattern(turns, nominal)
    sixth = trial(
        rng, case, pattern=true, believed=believed, yaw_jitter_deg=3.0, yaw_lag_deg=1.2
    )
    return sixth.error_deg


def disturbed(rng: Generator, pattern: AntennaPattern, sigma_db: float) -> AntennaPattern:
    """Antenna pattern as changed by the airframe: a smooth error of given rms, six
    harmonics.
    """
    angle = np.linspace(0.0, np.pi, len(pattern.e_plane_db))
    error = sum(rng.normal() * np.cos(order * angle) for order in range(1, 7))
    error = np.asarray(error) / np.sqrt(3.0) * sigma_db
    return AntennaPattern(
        name=f"{pattern.name} on an airframe",
        e_plane_db=tuple(float(x) for x in np.asarray(pattern.e_plane_db) + error),
    )


def nothing_there(runs: int, seed: int) -> list[Row]:
    """B6: noise, a steady interferer, and a reflection 50° from the tag."""
    yaw = np.arange(0.0, 360.0, 6.0)
    sources: dict[str, Callable[[Generator], np.ndarray[tuple[int], np.dtype[np.float64]]]] = {
        "noise alone": lambda rng: rng.exponential(size=60),
        "steady interferer, 20 dB": lambda rng: matched_power(rng, rng.normal(20.0, 2.0, 60)),
    }
    results = []
    for name, power in sources.items():
        rng = np.random.default_rng(seed)
        accepted = [
            float(estimate_bearing(yaw, None, matched_power=power(rng)).accepted)
            for _ in range(runs)
        ]
        results.append(measured("B6", name, "taken for a tag", accepted, share, most=0.01))
    for relative_db in (-3.0, 0.0, 3.0):
        rng = np.random.default_rng(seed)
        noticed = [float(_reflection_noticed(rng, relative_db)) for _ in range(runs)]
        name = f"reflection at 50°, {relative_db:+g} dB"
        results.append(measured("B6", name, "right or flagged", noticed, share, least=0.95))
    return results


def _reflection_noticed(rng: Generator, relative_db: float) -> bool:
    """True if the bearing of a turn next to a wall is within 10°, or marked as doubtful."""
    pattern, yaw = PATTERNS["RA-23K"], np.arange(0.0, 360.0, 6.0)
    truth, phase = rng.uniform(0.0, 360.0), rng.uniform(0.0, 2.0 * np.pi)
    direct = 10.0 ** ((20.0 + pattern.gain_db(truth - yaw)) / 20.0)
    echo = 10.0 ** ((20.0 + relative_db + pattern.gain_db(truth + 50.0 - yaw)) / 20.0)
    level = 20.0 * np.log10(np.abs(direct + echo * np.exp(1j * phase)) + 1e-6)
    power = matched_power(rng, level + rng.normal(0.0, 2.0, len(yaw)))
    found = estimate_bearing(yaw, None, matched_power=power)
    return found.ambiguous or abs(difference_deg(found.bearing_deg, truth)) <= 10.0


def _trials(runs: int, seed: int, run: Callable[[Generator], Trial]) -> list[Trial]:
    """Trials of a turn with the same seeds for every condition and method."""
    rng = np.random.default_rng(seed)
    return [run(rng) for _ in range(runs)]


def _lines(name: str, case: RotationCase, trials: list[Trial], most: float) -> list[Row]:
    errors = [one.error_deg for one in trials]
    gross = [float(abs(error) > 45.0) for error in errors]
    covered = [float(one.covered) for one in trials]
    condition = str(case)
    limits = (0.86, 0.94) if name in ("B1", "B2") else (None, None)
    return [
        measured(name, condition, "rms [°]", errors, rms, most=most, bound=bound_deg(case)),
        measured(name, condition, "over 45° off", gross, share, most=0.002),
        measured(
            name,
            condition,
            "90 % interval holds",
            covered,
            share,
            least=limits[0],
            most=limits[1],
        ),
    ]
