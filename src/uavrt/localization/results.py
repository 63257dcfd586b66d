"""Results of the estimators."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.units import wrap_degrees_360

BearingMethod = Literal[
    "pattern_ml",
    "pca",
    "pca_log",
    "pca_amplitude",
    "pearson",
    "ls_linear",
    "ls_db",
    "max",
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
    without: tuple["WithoutPrior", ...] = ()
    """The bearing without each prior of what its pulses may share; empty unless asked for."""

    @property
    def arc90_deg(self) -> float | None:
        """Width of `interval90_deg`; None when the method has no statistics."""
        if self.interval90_deg is None:
            return None
        low, high = self.interval90_deg
        return wrap_degrees_360(high - low)

    @property
    def widenings(self) -> tuple["ArcWidening", ...]:
        """What each prior does to the arc of 90 %, the most first."""
        own = self.arc90_deg
        found = [
            ArcWidening(
                prior=one.prior, text=one.text, arc90_without_deg=less, by_deg=own - less
            )
            for one in self.without
            if own is not None and (less := one.bearing.arc90_deg) is not None
        ]
        return tuple(sorted(found, key=lambda one: -one.by_deg))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the operator: why the arc is so wide."""
        if self.arc90_deg is None or not self.widenings:
            return ()
        changes = [(one.text, one.by_deg, one.arc90_without_deg) for one in self.widenings]
        return (_told(f"90 % arc {self.arc90_deg:.1f}°", changes, "{:.1f}°", _TOLD_DEG),)

    @property
    def accepted(self) -> bool:
        """Whether there is a direction in the data at all; methods without evidence say yes."""
        return self.evidence is None or self.evidence >= ACCEPTED_EVIDENCE

    @property
    def ambiguous(self) -> bool:
        """Whether another direction is nearly as good, or a reflection is likely."""
        second = self.second_lobe_probability
        return self.multipath_suspected or (
            second is not None and second >= BIMODAL_PROBABILITY
        )


FADING_TEXT = "fading that may last"
FOREIGN_TEXT = "pulses that may be of others"
"""The priors of what pulses share, for the operator: of a turn as of a survey."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WithoutPrior:
    """What a turn would say, were one error that its pulses may share impossible."""

    prior: Literal["fading", "foreign"]
    text: str
    """The prior, for the operator."""
    bearing: Bearing


@dataclass(frozen=True, slots=True, kw_only=True)
class ArcWidening:
    """What the prior of one shared error does to the arc of 90 %."""

    prior: Literal["fading", "foreign"]
    text: str
    """The prior, for the operator."""
    arc90_without_deg: float
    """The arc's width, were this impossible."""
    by_deg: float
    """How much wider the arc is with the prior; negative where it is narrower."""


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


SharedError = Literal["heading", "compass", "walk", "height", "fading", "foreign", "exponent"]
"""What all bearings of a flight may have wrong: headings that err a little, as is usual; a
compass that is far off; an animal that walks. And what all powers may: the height that is
told; fading that lasts; pulses of someone else; how strength falls with distance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Widening:
    """What the prior of one shared error does to the radius of 95 %."""

    prior: SharedError
    text: str
    """The prior, for the operator."""
    radius95_without_m: float
    """The radius, were this impossible."""
    by_m: float
    """How much wider the radius is with the prior; negative where it is narrower."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPoint:
    """Where a tag that moves was at a time, by all that the flight tells."""

    time_ns: int
    """UTC; from the first of what was heard where nobody knows it."""
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
    """What all headings of the flight seem to err by, clockwise; None when nothing tells."""
    heading_error_sigma_deg: float | None = None
    cautions: tuple[Caution, ...] = ()
    widenings: tuple[Widening, ...] = ()
    """What each prior does to `radius95_m`, the most first; empty unless asked for."""
    track: tuple[TrackPoint, ...] = ()
    """Where the tag went, in order of time; empty where nothing contradicts that it rests."""
    listeners: tuple[str, ...] = ()
    """What became of the strengths of each receiver that never turned, for the operator."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the operator: the cautions, and why the circles are so wide."""
        told = [one.text for one in self.cautions]
        if self.radius95_m is not None and self.widenings:
            changes = [(one.text, one.by_m, one.radius95_without_m) for one in self.widenings]
            least_m = max(_TOLD_M, _TOLD_SHARE * self.radius95_m)
            radius = f"95 % radius {self.radius95_m:.0f} m"
            told.append(_told(radius, changes, "{:.0f} m", least_m))
        return (*told, *self.listeners)


_TOLD_M = 0.5
_TOLD_SHARE = 0.01
"""Of a radius; less than both is rounded to nothing."""
_TOLD_DEG = 0.05


def _told(
    what: str, changes: Sequence[tuple[str, float, float]], form: str, least: float
) -> str:
    """Describe what each prior does to an arc or a radius.

    Parameters
    ----------
    what : str
        The arc or radius, with its size.
    changes : sequence of (str, float, float)
        Each prior, by how much it widens, and the size without it; the most first.
    form : str
        How a size is written.
    least : float
        What widens or narrows by less is not told.
    """
    wider = [one for one in changes if one[1] >= least]
    parts = [f"{form.format(by)} of it allow for {text}" for text, by, _ in wider[:1]]
    parts += [f"{form.format(by)} for {text}" for text, by, _ in wider[1:]]
    parts += [
        f"without {text} it would be {form.format(less)}"
        for text, by, less in changes
        if by <= -least
    ]
    if not parts:
        parts.append(f"{' or '.join(text for text, _, _ in changes)} adds nothing to it")
    return f"{what}: " + ", ".join(parts)
