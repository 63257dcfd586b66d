"""Loss behind hills: Fresnel's edge, Bullington's profile, and the view around a drone."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import fresnel
from terrain_loss import terrain_loss_db

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.runtime import native
from uavrt.localization.terrain.diffraction import bullington_db, knife_edge_db
from uavrt.localization.terrain.squares import GroundGrid
from uavrt.localization.terrain.viewshed import terrain_loss_map

_Floats = NDArray[np.float64]
PLANE = TangentPlane(latitude_deg=47.0, longitude_deg=8.0)


def land(height_m: _Floats, cell_m: float) -> GroundGrid:
    return GroundGrid(
        plane=PLANE,
        west_m=0.0,
        south_m=0.0,
        cell_m=cell_m,
        known=np.ones(height_m.shape, bool),
        height_m=height_m.astype(np.float32),
    )


def hills(side: int, cell_m: float, seed: int, *, relief_m: float = 60.0) -> GroundGrid:
    """Waves of 150 m to 2 km, the long ones high."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side] * cell_m
    height = np.zeros((side, side))
    for length in np.geomspace(150.0, 2000.0, 24):
        course, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
        along = (x * np.sin(course) + y * np.cos(course)) / length
        height += length / 2000.0 * np.sin(2.0 * np.pi * along + phase)
    return land(relief_m * height, cell_m)


def view(
    ground: GroundGrid, place: tuple[float, float], antenna_m: float
) -> NDArray[np.float32]:
    """Losses of a tag in each square."""
    return terrain_loss_map(
        ground,
        east_m=place[0],
        north_m=place[1],
        antenna_m=antenna_m,
        tag_m=0.5,
        frequency_hz=150e6,
    )


def test_one_edge_costs_what_fresnels_integral_says() -> None:
    for nu in np.linspace(-0.7, 6.0, 40):
        s, c = fresnel(nu)
        exact = -10.0 * math.log10(((0.5 - c) ** 2 + (0.5 - s) ** 2) / 2.0)
        assert float(knife_edge_db(np.array(nu))) == pytest.approx(exact, abs=0.35)


def test_level_ground_costs_nothing_beyond_the_reflected_ray() -> None:
    for far in (100.0, 1000.0, 5000.0):
        x = np.arange(0.0, far + 1.0, 5.0)
        loss = terrain_loss_db(
            x, np.zeros_like(x), antenna_m=60.0, tag_m=0.5, frequency_hz=150e6
        )
        assert loss < 0.5 + far / 2500.0  # the earth's own curve


def test_a_ridge_costs_its_edge_beyond_that_of_level_ground() -> None:
    x = np.arange(0.0, 2001.0, 5.0)
    ground = np.where(np.abs(x - 1500.0) < 1.0, 80.0, 0.0)
    loss = terrain_loss_db(x, ground, antenna_m=60.0, tag_m=0.5, frequency_hz=150e6)
    wavelength = 299_792_458.0 / 150e6
    over = 80.0 - 1500.0**2 / 17e6 - (60.0 + (0.5 - 2000.0**2 / 17e6 - 60.0) * 0.75)
    nu = over * math.sqrt(2.0 * 2000.0 / (wavelength * 1500.0 * 500.0))
    level = -2.0 * math.sqrt(2.0 * 60.0 * 0.5 / (wavelength * 2000.0))
    expected = bullington_db(np.array(nu), np.array(2000.0)) - bullington_db(
        np.array(level), np.array(2000.0)
    )
    assert loss == pytest.approx(float(expected), abs=0.05)
    assert 20.0 < loss < 40.0


def test_the_loss_is_the_same_from_either_end() -> None:
    rng = np.random.default_rng(2)
    x = np.arange(0.0, 3001.0, 10.0)
    for _ in range(20):
        ground = np.cumsum(rng.normal(0.0, 3.0, len(x)))
        there = terrain_loss_db(x, ground, antenna_m=60.0, tag_m=1.0, frequency_hz=150e6)
        back = terrain_loss_db(x, ground[::-1], antenna_m=1.0, tag_m=60.0, frequency_hz=150e6)
        assert there == pytest.approx(back, abs=0.01)


def test_behind_a_ridge_there_is_shadow_and_before_it_none() -> None:
    height = np.zeros((101, 201))
    height[:, 120:124] = 50.0
    grid = land(height, 10.0)
    loss = view(grid, (300.0, 500.0), 40.0)
    assert loss[:, :115].max() < 1.0
    assert loss[:, 126:].min() > 15.0
    # A drone twice as high as the ridge looks behind it.
    assert view(grid, (300.0, 500.0), 400.0)[:, 140:].max() < 3.0


def brute_force(
    ground: GroundGrid, place: tuple[float, float], antenna_m: float, cells: NDArray[np.intp]
) -> _Floats:
    """Loss by a profile of its own to each cell, by the scalar function."""
    columns = ground.height_m.shape[1]
    found = []
    for cell in cells:
        x, y = cell % columns * ground.cell_m, cell // columns * ground.cell_m
        far = math.hypot(x - place[0], y - place[1])
        if far < 1.0:
            found.append(0.0)
            continue
        share = np.linspace(0.0, 1.0, max(1, math.ceil(far / ground.cell_m)) + 1)
        profile = ground(place[0] + (x - place[0]) * share, place[1] + (y - place[1]) * share)
        found.append(
            terrain_loss_db(
                far * share, profile, antenna_m=antenna_m, tag_m=0.5, frequency_hz=150e6
            )
        )
    return np.array(found)


@pytest.mark.parametrize(
    ("seed", "place", "antenna_m"),
    [(1, (1000.0, 1000.0), 60.0), (2, (150.0, 1700.0), 30.0), (3, (1000.0, 40.0), 110.0)],
)
@pytest.mark.parametrize("pure", [False, True])
def test_the_view_is_within_half_a_decibel_of_brute_force(
    seed: int, place: tuple[float, float], antenna_m: float, pure: bool
) -> None:
    ground = hills(101, 20.0, seed)
    with native.numpy_only() if pure else nullcontext():
        loss = compared(ground, seed, place, antenna_m)
    assert 0.05 < np.mean(loss > 6.0) < 0.95  # there are shadows, and light


def compared(
    ground: GroundGrid, seed: int, place: tuple[float, float], antenna_m: float
) -> NDArray[np.float32]:
    loss = view(ground, place, antenna_m)
    cells = np.random.default_rng(seed).integers(0, loss.size, 1500)
    apart = np.abs(loss.ravel()[cells] - brute_force(ground, place, antenna_m, cells))
    assert np.mean(apart > 0.5) <= 0.001
    return loss


def test_rough_ground_is_no_worse() -> None:
    rng = np.random.default_rng(9)
    ground = land(hills(161, 5.0, 4).height_m + rng.normal(0.0, 0.5, (161, 161)), 5.0)
    compared(ground, 9, (400.0, 300.0), 50.0)


def test_kernels_refuse_what_they_cannot_read() -> None:
    kernels = native.kernels()
    if kernels is None or not hasattr(kernels, "edges"):
        pytest.skip(native.description())
    heights, out = np.zeros((6, 8), np.float32), np.zeros((5, 7), np.float32)
    more = (1.0, 1.0, 0.5, 10.0, 2.0, 1e-7)
    kernels.edges(heights, 8, *more, 0, out)
    for columns, first in ((5, 0), (8, 1), (0, 0), (8, -1), (1 << 40, 0)):
        with pytest.raises(ValueError, match="edges"):
            kernels.edges(heights, columns, *more, first, out)
    with pytest.raises(ValueError, match="edges"):
        kernels.edges(heights, 8, math.nan, *more[1:], 0, out)
