"""Each short form of a detection bar fails for a detector that is broken.

What is checked are the short forms in `tests/unit/experiments/test_detection_bars.py`.
"""

from collections.abc import Callable
from typing import Any

import made
import pytest
from tests.unit.experiments.test_detection_bars import CASES, missed

from uavrt.core.messages import Pulse
from uavrt.detection.coded.coded_detector import CodedDetector
from uavrt.detection.detector import PulseDetector
from uavrt.detection.search.refine import Measured
from uavrt.detection.track.judging import Judge
from uavrt_experiments.detection import trials
from uavrt_experiments.detection.campaign import short_rows


def deaf(self: PulseDetector | CodedDetector, *args: Any) -> list[Pulse]:
    """Hear nothing."""
    return []


def babbling(self: PulseDetector | CodedDetector, samples: Any, time_ns: int) -> list[Pulse]:
    """Confirm a pulse of each tag in each block, ten pulse widths behind its beginning."""
    tags = self.tags if isinstance(self, CodedDetector) else (self.tag,)
    return [
        made.pulse(
            time_ns,
            tag_id=tag.tag_id,
            frequency_hz=tag.frequency_hz + 77.0,
            score=1.0,
            group_index=0,
            group_sequence=time_ns // 1_000_000,
            noise_psd=1.0,
        )
        for tag in tags
    ]


def babbling_in_company(self: PulseDetector) -> list[Pulse]:
    """Confirm a pulse in each step."""
    return babbling(self, None, round(self.time_ns(self.now_s)))


@pytest.mark.parametrize("which", CASES, ids=" ".join)
def test_a_detector_that_hears_nothing_or_everything_misses_a_bar_of_each_case(
    which: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PulseDetector, "flush", deaf)
    monkeypatch.setattr(PulseDetector, "report_rest", deaf)
    monkeypatch.setattr(CodedDetector, "flush", deaf)
    assert any(
        misses_a_bar(which, monkeypatch, *broken)
        for broken in ((deaf, deaf), (babbling, babbling_in_company))
    )


def misses_a_bar(
    which: tuple[str, str],
    monkeypatch: pytest.MonkeyPatch,
    broken: Callable[..., list[Pulse]],
    in_company: Callable[..., list[Pulse]],
) -> bool:
    """Whether a case's short form shows a detector broken in this way."""
    monkeypatch.setattr(PulseDetector, "process", broken)
    monkeypatch.setattr(CodedDetector, "process", broken)
    # Of a group whose tags share a band the pulses are drained.
    monkeypatch.setattr(PulseDetector, "drain", in_company)
    try:
        rows = short_rows(CASES[which], 11)
    except (ValueError, IndexError, ZeroDivisionError, RuntimeWarning):
        return True  # no figure can be made of nothing
    return not any(row.barred for row in rows) or bool(missed(rows))


@pytest.mark.parametrize(
    "which",
    [
        ("E2", "pf 1 %"),
        ("E3", "K = 20, jitter 2 ms"),
        ("E4", "ENR 10 dB"),
        ("E8", "exact tag, no uncertainty"),
    ],
    ids=" ".join,
)
def test_a_detector_that_is_hard_of_hearing_fails_the_bars(
    which: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    hears = trials.detect

    def hard_of_hearing(*args: Any, **keywords: Any) -> Any:
        pulses, detector = hears(*args, **keywords)
        return [p for p in pulses if p.group_snr_db > 18.0], detector

    monkeypatch.setattr(trials, "detect", hard_of_hearing)
    assert missed(short_rows(CASES[which], 11))


@pytest.mark.parametrize("k", [20, 40])
def test_refusing_a_group_for_one_weak_pulse_fails_the_bars(
    k: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # What was once done: noise beside any one pulse, twice as strong, refused all.
    def refuse(self: Judge, places: list[tuple[int, Measured]], *args: Any, **more: Any) -> Any:
        beside = [self._refiner.strongest(pulse)[1] / pulse.power for _, pulse in places]
        return (places, None) if max(beside) < 2.0 else ([], "side lobe")

    monkeypatch.setattr(Judge, "own_pulses", refuse)
    assert missed(short_rows(CASES["E3", f"K = {k}, jitter 2 ms"], 11))
