"""Constants of planning that no user setting changes, in one frozen record."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningTuning:
    """Limits and step sizes for areas, coverage, division of tags, energy and range."""

    least_area_m2: float = 100.0
    """Minimum size of a search area [m²]."""
    listed_corners: int = 3
    """Maximum number of area corners outside the fence that an error message lists."""
    path_step_m: float = 5.0
    """Distance between the points of a path that are checked against fence and terrain [m]."""

    level_nodes: int = 9
    """Number of Gauss-Hermite nodes used in coverage maps to average over the error common to a
    tag's pulses."""
    no_level_db: float = -60.0
    """Energy-to-noise ratio assumed in coverage maps for cells without signal [dB]."""

    division_passes: int = 4
    """Maximum number of passes that improve the division of tags among drones."""
    transfer_s: float = 8.0
    """Flight time that must be saved for a tag to be transferred to another drone [s]."""
    stay_s: float = 6.0
    """Time at each tag of a round over all tags [s]: a turn towards it and its last pulses."""
    located_share: float = 0.5
    """Position spread below which one drone searches for a tag alone, as a share of the spread
    of positions distributed evenly over the area."""

    scale_drift: float = 0.03
    """Standard deviation added at each update to the ratio of measured to modelled power, since
    the wind changes."""
    return_climb_m_s: float = 3.0
    """Vertical speed assumed for the climb before the return flight [m/s]."""
    return_sink_m_s: float = 1.5
    """Vertical speed assumed for the descent to the landing [m/s]."""

    farthest_m: float = 100_000.0
    """Longest range that is computed for the reception of a tag [m]."""
    range_places: int = 4000
    """Number of distances at which the energy-to-noise ratio is computed to find a range."""
    table_step_m: float = 0.5
    """Distance step of the table of level corrections for the ground's reflection [m]."""

    drones_span_s: float = 1.0
    """Minimum duration over which another drone's remaining path is sampled [s]."""
    drones_samples: int = 8
    """Number of samples along another drone's planned path."""


PLANNING = PlanningTuning()
