"""Results of the estimators."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

BearingMethod = Literal[
    "pattern_ml", "pca", "pca_log", "pca_amplitude", "pearson", "ls_linear", "ls_db", "max"
]

ArrayMethod = Literal["pseudo_doppler", "two_point_phased", "amplitude_monopulse"]
"""Bearings from switched or fixed antennas (`uavrt.localization.bearing.array_bearings`)."""

ACCEPTED_EVIDENCE = 3.0
"""Least evidence (natural logarithm of a Bayes factor) for a bearing to be believed: odds of
20 to 1. Fewer than 1 % of noise-only rotations and of steady interferers reach it."""
BIMODAL_PROBABILITY = 0.05
"""From this probability of another lobe on, a bearing is called ambiguous."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bearing:
    """Direction to a tag from one place, degrees clockwise from true north, [0, 360)."""

    bearing_deg: float
    """Mean of the main lobe of the probability; of other methods, their answer."""
    method: BearingMethod | ArrayMethod | str
    pulses: int
    """Pulses and misses that went into it."""
    sigma_deg: float | None = None
    """Standard deviation inside the main lobe; None when the method has no statistics."""
    interval90_deg: tuple[float, float] | None = None
    """Shortest arc, clockwise from first to second, that holds 90 % of the posterior."""
    second_lobe_probability: float | None = None
    """Posterior probability of being more than 25° away from `bearing_deg`."""
    evidence: float | None = None
    """Natural logarithm of the Bayes factor "one direction" over "none": noise alone, or a
    source equally strong at every heading."""
    reduced_chi2: float | None = None
    """Misfit of the powers to pattern and fading; about 1 for an honest model."""
    multipath_suspected: bool = False
    """The residuals hang together over heading, or two paths explain the powers much better:
    there is a reflection, or the pattern is not this antenna's."""
    paths_deg: tuple[float, float] | None = None
    """Directions of the two paths when they are suspected, the stronger first; either may be
    the tag's."""
    fading_db: float | None = None
    """Standard deviation of the pulses' fading, estimated."""
    level_db: float | None = None
    """SNR that a pulse has on boresight, estimated."""
    level_sigma_db: float | None = None
    confidence: float | None = None
    """What the method itself calls confidence: tau of PCA, Pearson's correlation …"""
    posterior: NDArray[np.float64] | None = None
    """(360,) probability of the whole degrees 0, 1 … 359; sums to 1. What trackers consume."""

    @property
    def accepted(self) -> bool:
        """Whether there is a direction in the data at all; methods without evidence say yes."""
        return self.evidence is None or self.evidence >= ACCEPTED_EVIDENCE

    @property
    def ambiguous(self) -> bool:
        """Whether another direction fits nearly as well, or a reflection is likely."""
        second = self.second_lobe_probability
        return self.multipath_suspected or (
            second is not None and second >= BIMODAL_PROBABILITY
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What an operator must know beside the arc; empty where the direction is clear."""
        if not self.accepted:
            return ("there is no clear direction",)
        if self.multipath_suspected:
            return ("a reflection is likely, or the antenna differs from the setting",)
        return ("another direction fits nearly as well",) if self.ambiguous else ()


PositionMethod = Literal["bayes", "track", "mle", "rmr", "mest", "rmr_ahead", "mest_lenth"]
"""``track`` follows an animal that moves. ``mle``, ``rmr`` and ``mest`` are as the original
system computes them; ``rmr_ahead`` and ``mest_lenth`` as they were meant."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionGrid:
    """A probability over the ground: the heat map."""

    latitude_deg: float
    """Of the local plane's origin."""
    longitude_deg: float
    east_m: NDArray[np.float64]
    """(x,) centres of the cells, from the origin."""
    north_m: NDArray[np.float64]
    """(y,)."""
    probability: NDArray[np.float64]
    """(y, x) of each cell; sums to 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipse:
    """Where a tag is with 95 % probability, were its law normal."""

    semi_major_m: float
    semi_minor_m: float
    orientation_deg: float
    """Direction of the long axis, clockwise from true north, [0, 180)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Caution:
    """Something that makes a position less sure than its circles say, by name."""

    name: Literal[
        "compass",
        "walk",
        "contradiction",
        "outlier",
        "height",
        "foreign",
        "unchecked",
        "ground",
    ]
    text: str
    """For the operator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPoint:
    """Where a tag that moves was at a time, by all that the flight holds."""

    time_ns: int
    """UTC; from the first of what was heard where that is unknown."""
    latitude_deg: float
    longitude_deg: float
    radius50_m: float
    """Circle around the point that held the tag then with 50 % probability."""
    radius95_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Position:
    """Where a tag is."""

    latitude_deg: float
    longitude_deg: float
    method: PositionMethod | str
    stations: int
    """Bearings that went into it."""
    pulses: int = 0
    """Powers that went into it, missed ones included."""
    foreign_pulses: int = 0
    """Of these, left out again: they are rather someone else's."""
    radius50_m: float | None = None
    """Circle around the point that holds the tag with 50 % probability; None: not known."""
    radius95_m: float | None = None
    ellipse95: Ellipse | None = None
    outlier_probabilities: tuple[float, ...] | None = None
    """For each bearing, that it has nothing to do with the tag."""
    level_db: float | None = None
    """SNR that the tag would have 100 m away, when powers were used."""
    path_loss_exponent: float | None = None
    at_edge: bool = False
    """The search area cuts the probability: the tag may lie farther out."""
    grid: PositionGrid | None = None
    heading_error_deg: float | None = None
    """What all headings of the flight seem to err by, clockwise; None where unknown."""
    heading_error_sigma_deg: float | None = None
    cautions: tuple[Caution, ...] = ()
    track: tuple[TrackPoint, ...] = ()
    """Where the tag went, in order of time; empty where nothing contradicts that it rests."""
    listeners: tuple[str, ...] = ()
    """What became of the strengths of each receiver that never turned, for the operator."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the operator: the cautions, and what became of other receivers."""
        return (*(one.text for one in self.cautions), *self.listeners)
