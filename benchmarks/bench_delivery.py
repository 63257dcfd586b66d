"""Delivery without loss through simulated autopilot and radios, in virtual time (issue 4).

The real sender, pacing and receipts; the same runs hold the bars in
``tests/unit/ground/test_delivery_bars.py``.
"""

from collections.abc import Sequence
from itertools import pairwise

from benchmarks.harness import Table
from uavrt.ground.link.delivery_receipts import Receipts
from uavrt_experiments.packets.link_trial import LinkTrial, TrialResult, TrialSettings
from uavrt_experiments.packets.radio_link import RadioLinkSettings

THESIS_S = [3.0 + 3.762 * (index // 3) for index in range(1486)]
"""1486 pulses in groups of three (thesis §5.3): half an hour."""
EIGHT_A_SECOND_S = [3.0 + index / 8 for index in range(3000)]
FOUR_A_SECOND_S = [3.0 + index / 4 for index in range(2400)]


def run() -> list[Table]:
    """All tables of this section."""
    rows = [
        _row(
            f"thesis's load, {loss:.0%} loss",
            _trial(THESIS_S, radio=RadioLinkSettings(loss=loss, seed=11)),
            bar_s,
        )
        for loss, bar_s in ((0.0, None), (0.05, None), (0.2, 0.6), (0.4, None))
    ]
    ardupilot = _trial(
        EIGHT_A_SECOND_S,
        radio=RadioLinkSettings(loss=0.2, seed=12),
        radio_status=False,
        forwarding=False,
    )
    rows.append(_row("8 a second, 20 % loss, ArduPilot without RADIO_STATUS", ardupilot, 2.0))
    restarted = _trial(
        THESIS_S, radio=RadioLinkSettings(loss=0.2, seed=15), ground_restart_s=900.0
    )
    rows.append(_row("ground station restarted with an empty store", restarted, None))
    cut = _trial(
        FOUR_A_SECOND_S,
        radio=RadioLinkSettings(loss=0.05, down_from_s=100.0, down_until_s=400.0, seed=13),
    )
    rows.append(_row("4 a second, cut of five minutes", cut, None))
    notes = [
        "Simulated SiK radios at AIR_SPEED 64 with 1 kB/s of telemetry beside; PX4's queue at "
        "8.33 ms where not said otherwise.",
        f"After the cut {_newest_first(cut):.0%} of what it held back came the newest first; "
        f"at most {cut.most_in_memory} pulses were in memory.",
        "Latency is that of the first arrival; a restarted ground station's is of its second.",
    ]
    header = ["run", "sent", "missing", "sends a pulse", "p95 s", "dropped on the way", "bar"]
    return [Table(title="Delivery of pulses", header=header, rows=rows, notes=notes)]


def _trial(times_s: Sequence[float], **settings: object) -> TrialResult:
    trial = TrialSettings(**settings)  # type: ignore[arg-type]
    return LinkTrial(times_s, trial, Receipts).run()


def _row(name: str, result: TrialResult, bar_s: float | None) -> list[str]:
    p95_s = result.latency_s(0.95)
    late = bar_s is not None and p95_s > bar_s
    bar = "0 missing" if bar_s is None else f"0 missing, ≤ {bar_s:g} s"
    return [
        name,
        str(result.sent),
        str(len(result.missing)),
        f"{result.sends / result.sent:.2f}",
        f"{p95_s:.2f}",
        str(result.forwarding_dropped + result.buffer_full),
        f"{bar}: {'NOT met' if result.missing or late else 'met'}",
    ]


def _newest_first(result: TrialResult) -> float:
    """Share of the neighbours in the backlog of which the later pulse came first."""
    held = [i for _, i in result.arrivals if 105.0 < FOUR_A_SECOND_S[i] < 395.0]
    return sum(later < earlier for earlier, later in pairwise(held)) / max(1, len(held) - 1)
