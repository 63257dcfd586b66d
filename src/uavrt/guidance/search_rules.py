"""Constants of a search in flight: decisions, reports, and the energy estimate."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchRules:
    """Constants of a search that no setting changes."""

    cycle_s: float = 5.0
    """Time between two decisions in flight [s]."""
    same_goal_m: float = 10.0
    """Largest movement of a goal that still counts as the same goal, flown to its end [m]."""
    tag_height_m: float = 0.5
    """Height of tags above ground [m]."""
    few_tags: int = 5
    """Largest number of tags with `particles` hypotheses each; with more, `fewer_particles`."""
    particles: int = 10_000
    fewer_particles: int = 4_000
    turn_step_s: float = 2.7
    """Time between two headings of a turn in steps [s]."""
    circle_corners: int = 16
    """Number of corners of the outline of a circular search area."""

    kept_away: float = 0.99
    """Required probability of keeping the distance to animals, for each path and tag."""
    away_margin: float = 1.4
    """Factor on the distance to animals, for walking animals and rare errors of decisions."""
    approached: float = 2.0
    """Increase of the probability of a near animal at which a stay is reconsidered [ratio]."""

    report_gap_s: float = 3.0
    """Longest gap between two reports of a search [s]; one is sent each second."""
    # Greatest delay of a group's pulses after the group itself [intervals] and [s].
    late_intervals: float = 2.0
    late_s: float = 1.5
    kept_s: float = 60.0
    """Time for which the drone's past positions are stored [s]."""
    most_keys: int = 4096
    """Largest number of remembered pulses, by which repeated ones are recognised."""

    learns_percent: float = 3.0
    """Battery charge used between two updates of the power estimate [%]."""
    reading_share: float = 0.005
    """Error of the difference of two charge readings in whole percent [full battery = 1]."""
    # Uncertainty of the hovering power before the first lesson, unknown and given in the
    # settings, as a share of it; the way home allows for two. Drones take 400 to 1200 W.
    unknown_sigma: float = 1.0
    known_sigma: float = 0.25
    swapped_percent: float = 5.0
    """Rise of the charge that shows a changed battery [%]."""


SEARCH_RULES = SearchRules()
