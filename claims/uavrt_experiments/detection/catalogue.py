"""All experiments by name."""

from uavrt_experiments.detection.accuracy import E5, E6, E7
from uavrt_experiments.detection.cases import Experiment
from uavrt_experiments.detection.chance import E18
from uavrt_experiments.detection.coded import E23
from uavrt_experiments.detection.company import E12, E13
from uavrt_experiments.detection.false_alarms import E1
from uavrt_experiments.detection.ghosts import E22
from uavrt_experiments.detection.integration import E3
from uavrt_experiments.detection.jamming import E10, E11
from uavrt_experiments.detection.losses import E9
from uavrt_experiments.detection.one_band import E21
from uavrt_experiments.detection.promptness import E16
from uavrt_experiments.detection.rising import E17
from uavrt_experiments.detection.sensitivity import E2
from uavrt_experiments.detection.tracking import E4, E8

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *(E1, E2, E3, E4, E5, E6, E7, E8, E9, E10, E11, E12, E13),
        *(E16, E17, E18, E21, E22, E23),
    )
}
