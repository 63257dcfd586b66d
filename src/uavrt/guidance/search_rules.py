"""Constants of a search in flight: decisions, evaluation of pulses, and power estimate."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchRules:
    """Constants of a search that no setting can change."""

    cycle_s: float = 5.0
    """Time between two decisions where to search next, during a flight [s]."""
    same_goal_m: float = 10.0
    """Distance between new and present goal below which the drone keeps the present one [m]."""
    tag_height_m: float = 0.5
    """Height of tags above ground [m]."""
    few_tags: int = 5
    """Number of tags up to which a tag's position is described by `particles` hypotheses."""
    particles: int = 6_000
    fewer_particles: int = 4_000
    turn_step_s: float = 2.7
    """Additional time for each heading if a full turn is flown as separate headings [s]."""
    circle_corners: int = 16
    """Number of corners of the polygon that approximates a circular search area."""

    kept_away: float = 0.99
    """Required probability that a path keeps the protected distance from an animal, for each
    tag."""
    away_margin: float = 1.4
    """Ratio of planned to protected distance, as animals move and estimates are imperfect."""
    approached: float = 2.0
    """Factor by which the probability of too near an animal must rise to end a hover."""

    report_gap_s: float = 3.0
    """Largest time between reports of an uninterrupted search [s]; 1 s is usual."""
    # Greatest delay of a group's pulses after the group itself [intervals] and [s].
    late_intervals: float = 2.0
    late_s: float = 1.5
    kept_s: float = 60.0
    """Time for which the drone's positions are stored [s], as some pulses are reported late."""
    most_keys: int = 4096
    """Number of pulses that are remembered in order to ignore repeated ones."""

    learns_percent: float = 3.0
    """Charge that the battery must lose between two updates of the power estimate [%]."""
    reading_share: float = 0.005
    """Standard error of the difference between two charge readings, as a fraction of the
    capacity; readings are whole percents."""
    # Standard deviation of the hovering power before its first update, unknown and given in the
    # settings, as a share of it; the return allows for two. Drones take 400 to 1200 W.
    unknown_sigma: float = 1.0
    known_sigma: float = 0.25
    swapped_percent: float = 5.0
    """Rise of the charge from which the battery counts as changed [%]."""


SEARCH_RULES = SearchRules()
