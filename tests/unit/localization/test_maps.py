"""What maps are drawn from: outlines of regions, and the strongest signal by its name."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.localization.antenna import monopole_gain_db
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.levels.strongest import signal_surface, strongest_signal
from uavrt.localization.position.regions import refined, region_outlines
from uavrt.localization.results import PositionGrid

PLANE = TangentPlane(latitude_deg=-12.0, longitude_deg=131.0)
AXIS = np.arange(-200.0, 201.0, 4.0)
Floats = NDArray[np.float64]


def grid_of(density: Floats) -> PositionGrid:
    return PositionGrid(
        latitude_deg=PLANE.latitude_deg,
        longitude_deg=PLANE.longitude_deg,
        east_m=AXIS,
        north_m=AXIS,
        probability=density / density.sum(),
    )


def area_m2(ring: Floats) -> float:
    """Signed: positive is counter-clockwise."""
    east, north = PLANE.to_local(ring[:, 1], ring[:, 0])
    return float(np.sum(east[:-1] * north[1:] - east[1:] * north[:-1]) / 2.0)


def spot(east_m: float, north_m: float, sigma_m: float) -> Floats:
    east, north = np.meshgrid(AXIS, AXIS)
    return np.asarray(
        np.exp(-((east - east_m) ** 2 + (north - north_m) ** 2) / (2 * sigma_m**2))
    )


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_the_outline_of_a_normal_spot_is_its_circle(share: float) -> None:
    (ring,) = region_outlines(grid_of(spot(30.0, -20.0, 25.0)), share)
    assert ring[0].tolist() == ring[-1].tolist()
    radius = 25.0 * np.sqrt(-2.0 * np.log(1.0 - share))
    assert area_m2(ring) == pytest.approx(np.pi * radius**2, rel=0.03)
    east, north = PLANE.to_local(ring[:, 1], ring[:, 0])
    assert np.hypot(east - 30.0, north + 20.0) == pytest.approx(radius, rel=0.05)


def test_two_spots_have_two_rings_and_a_ring_has_a_hole() -> None:
    pair = region_outlines(grid_of(spot(-100.0, 0.0, 15.0) + spot(100.0, 0.0, 15.0)), 0.9)
    assert [area_m2(ring) > 0 for ring in pair] == [True, True]
    east, north = np.meshgrid(AXIS, AXIS)
    annulus = np.exp(-((np.hypot(east, north) - 100.0) ** 2) / 200.0)
    areas = sorted(area_m2(ring) for ring in region_outlines(grid_of(annulus), 0.9))
    assert len(areas) == 2
    assert areas[0] < 0 < areas[1]


def test_a_region_cut_by_the_search_area_is_closed() -> None:
    (ring,) = region_outlines(grid_of(spot(200.0, 0.0, 60.0)), 0.9)
    assert ring[0].tolist() == ring[-1].tolist()
    assert area_m2(ring) > 0


def test_cells_that_touch_at_a_corner_make_closed_rings_either_way() -> None:
    rng = np.random.default_rng(61)
    for _ in range(3):
        rings = region_outlines(grid_of(rng.random((len(AXIS), len(AXIS)))), 0.6)
        assert all(np.array_equal(ring[0], ring[-1]) for ring in rings)
        assert sum(area_m2(ring) for ring in rings) > 0


def test_refining_keeps_the_probability_where_it_was() -> None:
    x, y = np.linspace(0.0, 10.0, 11), np.linspace(0.0, 8.0, 9)
    bell = np.exp(-((x[None, :] - 4.0) ** 2) / 3.0 - (y[:, None] - 5.0) ** 2)
    fine_x, fine_y, fine = refined(x, y, bell / bell.sum())
    assert fine.shape == (33, 41)
    assert fine.sum() == pytest.approx(1.0)
    assert fine_x[fine.argmax() % 41] == pytest.approx(4.0)
    assert fine_y[fine.argmax() // 41] == pytest.approx(5.0)
    exact = np.exp(-((fine_x[None, :] - 4.0) ** 2) / 3.0 - (fine_y[:, None] - 5.0) ** 2)
    np.testing.assert_allclose(fine, exact / exact.sum(), atol=2e-4)


def lines_over(tag: tuple[float, float]) -> PowerTrack:
    east, north = map(
        np.ravel, np.meshgrid(np.arange(-150, 151, 25.0), np.arange(-150, 151, 10.0))
    )
    slant = np.sqrt((east - tag[0]) ** 2 + (north - tag[1]) ** 2 + 40.0**2)
    gain = monopole_gain_db(np.degrees(np.arcsin(40.0 / slant)))
    latitude, longitude = PLANE.to_geodetic(east, north)
    return PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(len(east), 40.0),
        snr_db=40.0 - 25.0 * np.log10(slant / 100.0) + gain,
    )


def test_the_strongest_signal_lies_on_the_ring_around_the_tag() -> None:
    found = strongest_signal(lines_over((5.0, 15.0)))
    east, north = PLANE.to_local(found.latitude_deg, found.longitude_deg)
    assert found.ring_radius_m == pytest.approx(35.8, abs=0.1)
    assert np.hypot(east - 5.0, north - 15.0) == pytest.approx(found.ring_radius_m, abs=20.0)


def test_the_signal_surface_has_a_hollow_over_the_tag() -> None:
    surface = signal_surface(lines_over((0.0, 0.0)))
    rows, columns = surface.snr_db.shape
    assert (rows, columns) == (len(surface.north_m), len(surface.east_m))
    middle = surface.snr_db[rows // 2, columns // 2]
    assert middle < np.nanmax(surface.snr_db) - 3.0


def test_maps_of_nothing_are_refused() -> None:
    track = lines_over((0.0, 0.0))
    silent = replace(track, snr_db=np.full(len(track.snr_db), np.nan))
    for draw in (strongest_signal, signal_surface):
        with pytest.raises(UsageError, match="Fly nearer"):
            draw(silent)
    one_line = PowerTrack(
        latitude_deg=np.full(20, -12.0),
        longitude_deg=np.linspace(131.0, 131.002, 20),
        height_m=np.full(20, 40.0),
        snr_db=np.full(20, 20.0),
    )
    with pytest.raises(UsageError, match="several lines"):
        signal_surface(one_line)
