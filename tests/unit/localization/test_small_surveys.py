"""Surveys narrower than three heights: no other place is far likelier than the reported one."""

import numpy as np
import pytest
from depth import seeds
from scipy.signal import lfilter

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization import PowerTrack, estimate_position
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerEvidence

PLANE = TangentPlane(latitude_deg=47.0, longitude_deg=8.0)
HEIGHT_M, PULSES, HALF_M = 30.0, 340, 40.0


@pytest.mark.parametrize("spacing_m", [12.0, 24.0])
@pytest.mark.parametrize("south_m", [(-35.0, 35.0), (-50.0, -30.0)], ids=["inside", "outside"])
def test_the_truth_is_never_far_likelier_than_the_reported_place(
    south_m: tuple[float, float], spacing_m: float
) -> None:
    way = np.arange(PULSES) * 1.6
    line, along = np.divmod(way, 2.0 * HALF_M)
    east = np.where(line % 2 == 0, along - HALF_M, HALF_M - along)
    north = (line * spacing_m) % 72.0 - 30.0
    latitude, longitude = PLANE.to_geodetic(east, north)
    held = 0
    for seed in seeds(8, 24):
        rng = np.random.default_rng(seed)
        tag = rng.uniform(-35.0, 35.0), rng.uniform(*south_m)
        ground = np.hypot(east - tag[0], north - tag[1])
        slant = np.hypot(ground, HEIGHT_M)
        fading = 1.6 * lfilter([0.8], [1.0, -0.6], rng.normal(size=PULSES))
        snr_db = 40.0 - 25.0 * np.log10(slant / 30.0) + fading
        snr_db += 20.0 * np.log10(np.maximum(ground / slant, 0.03))
        track = PowerTrack(
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_m=np.full(PULSES, HEIGHT_M),
            snr_db=snr_db,
        )
        found = estimate_position(powers=track)
        x, y = PLANE.to_local(np.array([found.latitude_deg]), np.array([found.longitude_deg]))
        fit = PowerEvidence(east, north, track, Propagation()).fit(
            np.array([tag[0], x[0]]), np.array([tag[1], y[0]])
        )
        truth, reported = fit.log_likelihood
        assert truth - reported <= 10.0
        held += int(np.hypot(x[0] - tag[0], y[0] - tag[1]) <= found.radius95_m)
    assert held >= 0.87 * (seed + 1)
