"""Surveys narrower than three heights: no other place is far likelier than the reported one."""

import numpy as np
import pytest
from depth import seeds
from some import some

from uavrt.localization import estimate_position
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerEvidence
from uavrt_experiments.localization.small_survey_bars import PLANE, small_survey


@pytest.mark.parametrize("spacing_m", [12.0, 24.0])
@pytest.mark.parametrize("south_m", [(-35.0, 35.0), (-50.0, -30.0)], ids=["inside", "outside"])
def test_the_truth_is_never_far_likelier_than_the_reported_place(
    south_m: tuple[float, float], spacing_m: float
) -> None:
    held = 0
    for seed in seeds(8, 24):
        rng = np.random.default_rng(seed)
        flown = small_survey(rng, spacing_m=spacing_m, south_m=south_m, place_sigma_m=0.0)
        found = estimate_position(powers=flown.track)
        x, y = PLANE.to_local(found.latitude_deg, found.longitude_deg)
        east, north = PLANE.to_local(flown.track.latitude_deg, flown.track.longitude_deg)
        fit = PowerEvidence(east, north, flown.track, Propagation()).fit(
            np.array([flown.tag_m[0], x]), np.array([flown.tag_m[1], y])
        )
        truth, reported = fit.log_likelihood
        assert truth - reported <= 10.0
        held += int(flown.miss_m(found) <= some(found.radius95_m))
    assert held >= 0.87 * (seed + 1)
