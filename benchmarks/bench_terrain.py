"""What hills cost: a drone's view of a large map, and the coverage of a plan over them.

Bars: 4 million cells from one place in 20 s, and a plan of 1000 places over 1 km² in squares of
5 m in 60 s of one core.
"""

import time
from collections.abc import Callable

import numpy as np

from benchmarks.harness import Table
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Tag
from uavrt.localization.terrain.squares import GroundGrid
from uavrt.localization.terrain.viewshed import terrain_loss_map
from uavrt.planning.detectability.detection_coverage import coverage_of, planned_antenna_path
from uavrt.planning.detectability.link_budget import LinkBudget
from uavrt_experiments.search.terrain import Hills

CELL_M = 5.0
VIEW_CELLS = 2000
"""On each side: 4 million in all."""
PLAN_CELLS = 200
PLAN_PLACES = 1000
FREQUENCY_HZ = 150e6
DRONE_M, TAG_M = 60.0, 0.5
RELIEF_M = 200.0
ROUNDS = 3
_TAG = Tag(
    tag_id=1,
    frequency_hz=FREQUENCY_HZ,
    pulse_width_s=0.02,
    pulse_intervals_s=(1.254,),
    interval_uncertainty_s=0.06,
    interval_jitter_s=0.01,
    k=3,
)


def run() -> list[Table]:
    """Measure."""
    square = PLAN_CELLS * CELL_M
    return [
        Table(
            title="The ground between",
            header=["", "CPU s, the best of three", "bar"],
            rows=[
                _row(f"view of {VIEW_CELLS**2:,} cells from one place", _view, 20.0),
                _row(
                    f"plan of {PLAN_PLACES} places over {square:.0f} m square, "
                    f"cells of {CELL_M:.0f} m",
                    _plan,
                    60.0,
                ),
            ],
            notes=[f"Hills of {RELIEF_M:.0f} m, the drone {DRONE_M:.0f} m above them."],
        )
    ]


def _row(name: str, work: Callable[[int], float], most_s: float) -> list[str]:
    best = min(work(seed) for seed in range(ROUNDS))
    return [name, f"{best:.1f}", f"≤ {most_s:g} s: {'met' if best <= most_s else 'NOT met'}"]


def _ground(cells: int, seed: int) -> GroundGrid:
    """Hills around the origin."""
    half_m = 0.5 * CELL_M * (cells - 1)
    axis = np.linspace(-half_m, half_m, cells)
    height = np.concatenate(
        [
            Hills(seed=seed, relief_m=RELIEF_M)(*np.meshgrid(axis, part))
            for part in np.array_split(axis, 20)
        ]
    )
    return GroundGrid(
        plane=TangentPlane(latitude_deg=47.0, longitude_deg=8.0),
        west_m=-half_m,
        south_m=-half_m,
        cell_m=CELL_M,
        known=np.ones(height.shape, bool),
        height_m=height.astype(np.float32),
    )


def _view(seed: int) -> float:
    """CPU seconds."""
    ground = _ground(VIEW_CELLS, seed)
    began_s = time.process_time()
    terrain_loss_map(
        ground,
        east_m=0.0,
        north_m=0.0,
        antenna_m=DRONE_M,
        tag_m=TAG_M,
        frequency_hz=FREQUENCY_HZ,
    )
    return time.process_time() - began_s


def _plan(seed: int) -> float:
    """CPU seconds of lanes over the square, a pulse at each place."""
    ground = _ground(PLAN_CELLS, seed)
    half_m, lanes = 0.45 * PLAN_CELLS * CELL_M, 10
    corners = [
        (
            half_m * (1.0 if (lane + end) % 2 else -1.0),
            half_m * (2.0 * lane / (lanes - 1) - 1.0),
        )
        for lane in range(lanes)
        for end in (0, 1)
    ]
    length_m = 2.0 * half_m * (lanes + 1)
    interval_s = _TAG.pulse_intervals_s[0]
    way = planned_antenna_path(
        corners,
        height_m=DRONE_M,
        speed_m_s=length_m / (PLAN_PLACES - 0.5) / interval_s,
        interval_s=interval_s,
    )
    assert len(way.time_s) == PLAN_PLACES
    budget = LinkBudget(
        frequency_hz=FREQUENCY_HZ,
        pulse_width_s=_TAG.pulse_width_s,
        tag_eirp_dbm=-63.0,
        drone_height_m=DRONE_M,
    )
    began_s = time.process_time()
    coverage_of(ground, way, _TAG, budget)
    return time.process_time() - began_s
