"""Records of estimated bearings, positions and tracks."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.tuning import ACCEPTANCE

BearingMethod = Literal[
    "pattern_ml", "pca", "pca_log", "pca_amplitude", "pearson", "ls_linear", "ls_db", "max"
]

ArrayMethod = Literal["pseudo_doppler", "two_point_phased", "amplitude_monopulse"]
"""Name of a bearing method for several antennas in
`uavrt.localization.bearing.array_bearings`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bearing:
    """Direction to a tag from one position, degrees clockwise from true north, [0, 360)."""

    bearing_deg: float
    """Mean of the posterior's main lobe [deg]; for a method without posterior, the method's
    result."""
    method: BearingMethod | ArrayMethod | str
    pulses: int
    """Number of received and missed pulses used for the bearing."""
    sigma_deg: float | None = None
    """Standard deviation within the main lobe [deg]; None for a method without statistics."""
    interval90_deg: tuple[float, float] | None = None
    """Shortest arc that contains 90 % of the posterior: its start, and its end in clockwise
    direction [deg]."""
    second_lobe_probability: float | None = None
    """Posterior probability that the tag is more than 25° away from `bearing_deg`."""
    evidence: float | None = None
    """Logarithm of the Bayes factor for one direction against noise or a uniform source."""
    reduced_chi2: float | None = None
    """Misfit of the powers to pattern and fading (reduced chi²), about 1 if the model is
    right."""
    multipath_suspected: bool = False
    """True if residuals are correlated over heading, or if two paths fit much better. The cause
    is a reflection, or a pattern that is not that of this antenna."""
    paths_deg: tuple[float, float] | None = None
    """Directions of two suspected propagation paths, the stronger first [deg]; the tag may be
    in either direction."""
    fading_db: float | None = None
    """Estimated standard deviation of the fading from pulse to pulse [dB]."""
    level_db: float | None = None
    """Estimated SNR that a pulse had on boresight during the turn [dB]."""
    level_sigma_db: float | None = None
    confidence: float | None = None
    """Confidence as the method defines it, such as tau of PCA or Pearson's correlation."""
    posterior: NDArray[np.float64] | None = None
    """Probability of the whole degrees 0, 1 … 359, shape (360,), with sum 1; used by
    trackers."""

    @property
    def accepted(self) -> bool:
        """True if the data show a direction; always True for methods without evidence."""
        return self.evidence is None or self.evidence >= ACCEPTANCE.evidence_nats

    @property
    def ambiguous(self) -> bool:
        """True if another direction fits nearly as well, or a reflection is likely."""
        second = self.second_lobe_probability
        return self.multipath_suspected or (
            second is not None and second >= ACCEPTANCE.second_lobe
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the operator on an unclear direction; empty if the direction is clear."""
        if not self.accepted:
            return ("the pulses show no clear direction",)
        if self.multipath_suspected:
            return (
                "the signal was probably reflected, or the antenna is not the one in the "
                "settings",
            )
        return ("the pulses fit another direction nearly as well",) if self.ambiguous else ()


PositionMethod = Literal["bayes", "track", "mle", "rmr", "mest", "rmr_ahead", "mest_lenth"]
"""Name of a position estimator. ``mle``, ``rmr`` and ``mest`` are computed as in UAV-RT;
``rmr_ahead`` and ``mest_lenth`` are corrected. ``track`` follows a moving tag."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PositionGrid:
    """Probability of a tag's position on a grid over the ground, shown as a heat map."""

    latitude_deg: float
    """Latitude of the origin of the position map's local plane [deg]."""
    longitude_deg: float
    east_m: NDArray[np.float64]
    """Centres of the map's cells, east of the origin [m], shape (x,)."""
    north_m: NDArray[np.float64]
    """Centres of the map's cells, north of the origin [m], shape (y,)."""
    probability: NDArray[np.float64]
    """Probability that the tag is in each cell, shape (y, x), with sum 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipse:
    """Ellipse that contains a tag with 95 % probability if its error is normal."""

    semi_major_m: float
    semi_minor_m: float
    orientation_deg: float
    """Direction of the ellipse's long axis [deg], clockwise from true north, [0, 180)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Caution:
    """Name and text of a reason why a position is less certain than its circles show."""

    name: Literal[
        "compass",
        "walk",
        "contradiction",
        "outlier",
        "height",
        "foreign",
        "unchecked",
        "ground",
        "observer",
        "noise",
    ]
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPoint:
    """Position of a moving tag at one time, estimated from all data of the flight."""

    time_ns: int
    """Time of the point [ns, UTC]; if UTC is unknown, relative to the first pulse."""
    latitude_deg: float
    longitude_deg: float
    radius50_m: float
    """Radius of the circle around the point that contained the tag with 50 % probability
    [m]."""
    radius95_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Position:
    """Estimated position of a tag."""

    latitude_deg: float
    longitude_deg: float
    method: PositionMethod | str
    stations: int
    """Number of bearings used for the position."""
    pulses: int = 0
    """Number of pulse powers used for the position, missed pulses included."""
    foreign_pulses: int = 0
    """Number of pulses that were excluded because they probably came from another sender."""
    radius50_m: float | None = None
    """Radius of the circle that contains the tag with 50 % probability [m]; None if unknown."""
    radius95_m: float | None = None
    ellipse95: Ellipse | None = None
    outlier_probabilities: tuple[float, ...] | None = None
    """Probability that each bearing is unrelated to the tag."""
    level_db: float | None = None
    """SNR of the tag at 100 m [dB]; None if no powers were used."""
    path_loss_exponent: float | None = None
    at_edge: bool = False
    """True if the search area cuts off part of the posterior, so that the tag may be farther
    away."""
    grid: PositionGrid | None = None
    heading_error_deg: float | None = None
    """Estimated error common to all headings [deg], positive clockwise; None if unknown."""
    heading_error_sigma_deg: float | None = None
    cautions: tuple[Caution, ...] = ()
    track: tuple[TrackPoint, ...] = ()
    """Path of the tag in order of time; empty if a fixed position explains the data."""
    listeners: tuple[str, ...] = ()
    """Sentences for the operator about each receiver that never turned, and about people who
    took bearings."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the operator: the cautions, and whether other receivers were used."""
        return (*(one.text for one in self.cautions), *self.listeners)
