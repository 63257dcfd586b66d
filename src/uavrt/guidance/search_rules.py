"""Constants of a search in flight: decisions, reports, and the energy estimate."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchRules:
    """Constants of a search that no setting changes."""

    cycle_s: float = 5.0
    """Time between two decisions in flight [s]."""
    same_goal_m: float = 10.0
    """Movement of a goal below which it counts as the same and is flown to its end [m]."""
    tag_height_m: float = 0.5
    """Height of tags above ground [m]."""
    few_tags: int = 5
    """Most tags for `particles` hypotheses of each; with more, `fewer_particles`."""
    particles: int = 10_000
    fewer_particles: int = 4_000
    turn_step_s: float = 2.7
    """Time between two headings of a turn in steps [s]."""
    circle_corners: int = 16
    """Number of corners of the outline around a position."""

    kept_away: float = 0.99
    """Required probability, for each path and tag, that the distance to animals is kept."""
    away_margin: float = 1.4
    """Factor on the distance to animals, for walking ones and rare errors of decisions."""
    approached: float = 2.0
    """Factor on the probability of a near animal at which a stay is reconsidered."""

    report_gap_s: float = 3.0
    """Longest gap between reports of a search [s], which come each second."""
    # Greatest delay of a group's pulses after the group itself [intervals] and [s].
    late_intervals: float = 2.0
    late_s: float = 1.5
    kept_s: float = 60.0
    """Time for which the drone's positions are remembered [s]."""
    most_keys: int = 4096
    """Most pulses remembered to recognise repetitions."""

    learns_percent: float = 3.0
    """Use of the battery between two updates of the power estimate [%]."""
    reading_share: float = 0.005
    """Error of the difference of two whole-percent readings, as a share of the battery."""
    # Uncertainty of the hovering power before the first lesson, unknown and given in the
    # settings, as a share of it; the way home allows for two. Drones take 400 to 1200 W.
    unknown_sigma: float = 1.0
    known_sigma: float = 0.25
    swapped_percent: float = 5.0
    """Rise of the charge that shows another battery [%]."""


SEARCH_RULES = SearchRules()
