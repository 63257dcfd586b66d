"""Constants of a search in flight: decisions, reports, and the energy estimate."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchRules:
    """Constants of a search that no setting changes."""

    cycle_s: float = 5.0
    """Time between two decisions on where to search next, while the drone flies a leg [s]."""
    same_goal_m: float = 10.0
    """Distance from old to new goal below which the drone flies on to the old goal [m]."""
    tag_height_m: float = 0.5
    """Height of tags above ground [m]."""
    few_tags: int = 5
    """Number of tags up to which a tag's position is described by `particles` hypotheses."""
    particles: int = 6_000
    fewer_particles: int = 4_000
    turn_step_s: float = 2.7
    """Extra time per heading when a full turn is flown as single headings [s]."""
    circle_corners: int = 16
    """Number of corners of the polygon that replaces a circular search area."""

    kept_away: float = 0.99
    """Required probability of keeping the protected distance to animals, per path and tag."""
    away_margin: float = 1.4
    """Factor on the protected distance to animals: they walk, and decisions err at times."""
    approached: float = 2.0
    """Factor by which the probability of a too near animal must rise to reconsider a stay."""

    report_gap_s: float = 3.0
    """Longest gap between a detector's search reports in one search [s]; usual: one second."""
    # Greatest delay of a group's pulses after the group itself [intervals] and [s].
    late_intervals: float = 2.0
    late_s: float = 1.5
    kept_s: float = 60.0
    """Time for which the drone's positions are kept, to locate pulses reported late [s]."""
    most_keys: int = 4096
    """Largest number of remembered pulses, by which repeated ones are recognised."""

    learns_percent: float = 3.0
    """Battery charge used between two updates of the power estimate [%]."""
    reading_share: float = 0.005
    """Error of the difference of two charge readings in whole percent [full battery = 1]."""
    # Standard deviation of the hovering power before its first update, unknown and given in the
    # settings, as a share of it; the return allows for two. Drones take 400 to 1200 W.
    unknown_sigma: float = 1.0
    known_sigma: float = 0.25
    swapped_percent: float = 5.0
    """Rise of the reported charge that shows a changed battery [%]."""


SEARCH_RULES = SearchRules()
