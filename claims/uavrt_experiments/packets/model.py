"""The thesis's half an hour over a lossy radio, in virtual time."""

from dataclasses import dataclass

from uavrt.ground.link.delivery_receipts import Receipts
from uavrt_experiments.packets.link_trial import LinkTrial, TrialSettings
from uavrt_experiments.packets.radio_link import RadioLinkSettings
from uavrt_experiments.result import Row

PULSES = 1486
"""Number of pulses in the thesis's §5.3."""
GROUP_S = 3 * 1.254
LOSSES = (0.0, 0.05, 0.2, 0.4)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRow:
    """Result of one run over the simulated radios."""

    gap_s: float
    loss: float
    acknowledged: bool
    """True if the ground station acknowledges."""
    sent: int
    received: int
    sends: int
    p95_s: float
    dropped_by_autopilot: int
    dropped_by_radio: int
    lost_in_the_air: int

    @property
    def result(self) -> Row:
        """Row with the missing pulses; none may be missing if the ground acknowledges."""
        ground = "ground acknowledges" if self.acknowledged else "plain ground"
        return Row.counted(
            "packets",
            "pulses missing through SiK radios",
            f"{ground}, {self.gap_s * 1e3:.0f} ms, loss {self.loss:.0%}",
            self.sent - self.received,
            self.sent,
            most=0 if self.acknowledged else None,
            note=f"{self.sends} sends, p95 {self.p95_s:.2f} s; frames lost: autopilot "
            f"{self.dropped_by_autopilot}, radio buffer {self.dropped_by_radio}, "
            f"air {self.lost_in_the_air}",
        )


def model_rows(
    pulses: int = PULSES, losses: tuple[float, ...] = LOSSES, seed: int = 1
) -> list[ModelRow]:
    """Run the load of §5.3, in groups of three, at both gaps and every loss."""
    return [
        _run(pulses, gap_s, loss, acknowledged, seed)
        for acknowledged in (True, False)
        for gap_s in (0.012, 0.020)
        for loss in losses
    ]


def _run(pulses: int, gap_s: float, loss: float, acknowledged: bool, seed: int) -> ModelRow:
    times_s = [3.0 + GROUP_S * (index // 3) for index in range(pulses)]
    settings = TrialSettings(
        radio=RadioLinkSettings(loss=loss, seed=seed), gap_s=gap_s, drain_s=120.0
    )
    result = LinkTrial(times_s, settings, Receipts if acknowledged else None).run()
    return ModelRow(
        gap_s=gap_s,
        loss=loss,
        acknowledged=acknowledged,
        sent=result.sent,
        received=result.received,
        sends=result.sends,
        p95_s=result.latency_s(0.95),
        dropped_by_autopilot=result.forwarding_dropped,
        dropped_by_radio=result.buffer_full,
        lost_in_the_air=result.lost_in_the_air,
    )
