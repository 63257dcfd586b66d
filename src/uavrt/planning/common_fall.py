"""Share what each tag's pulses show about the path loss exponent among all tags of one area.

Each tracker learns its own exponent. But the exponent depends on the ground and plants of the
area, so a flight around one tag measures it for all tags. Without sharing, each other tag keeps
two hypotheses (near and weak, far and strong) for minutes.

Each tag's likelihood of the exponent is approximated as normal: its posterior divided by its
prior and by the other tags' messages. This is expectation propagation with one message for each
tag (Minka 2001, "Expectation Propagation for Approximate Bayesian Inference"). So a tag never
receives its own information back.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from uavrt.planning.beliefs import TagBelief


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sharing:
    """Constants that control how tags share the path loss exponent."""

    exponent_sigma: float = 0.15
    """Standard deviation of the difference between two tags' path loss exponents in the same
    area."""
    existence: float = 0.95
    """Minimum probability of existence at which a tag's path loss exponent is shared with other
    tags."""
    news: float = 1.25
    """Ratio by which the precision of a tag's path loss exponent must grow before it is shared
    again."""
    placed_m: float = 50.0
    """Largest rms position spread at which a tag counts as located [m]."""
    most_precision: float = 1.0 / 0.1**2
    """Largest precision (inverse variance) of the path loss exponent that one tag's pulses may
    contribute."""


_SHARING = _Sharing()


@dataclass(frozen=True, slots=True, kw_only=True)
class _ExponentMessage:
    """Normal likelihood of the path loss exponent in natural parameters, so that messages
    combine by addition.
    """

    precision: float = 0.0
    weighted: float = 0.0
    """Product of mean and precision of the path loss exponent."""

    def plus(self, other: "_ExponentMessage") -> "_ExponentMessage":
        return _ExponentMessage(
            precision=self.precision + other.precision, weighted=self.weighted + other.weighted
        )

    def minus(self, other: "_ExponentMessage") -> "_ExponentMessage":
        return _ExponentMessage(
            precision=self.precision - other.precision, weighted=self.weighted - other.weighted
        )

    def scaled(self, share: float) -> "_ExponentMessage":
        return _ExponentMessage(
            precision=self.precision * share, weighted=self.weighted * share
        )

    def softened(self, variance: float) -> "_ExponentMessage":
        """Return the message for another tag, less precise because that tag's exponent may
        differ by a given variance.
        """
        return self.scaled(1.0 / (1.0 + variance * self.precision))


class ExponentSharing:
    """Passes information on the path loss exponent from each tag's pulses to all other tags."""

    def __init__(self) -> None:
        self._variance = _SHARING.exponent_sigma**2
        self._sent: dict[int, _ExponentMessage] = {}
        self._received: dict[int, _ExponentMessage] = {}

    def share(self, beliefs: Iterable[TagBelief]) -> None:
        """Pass each tag's information on the path loss exponent to all other tags."""
        learning = [one for one in beliefs if one.prior.exponent_sigma > 0.0]
        if len(learning) < 2:
            return
        for one in learning:
            self._collect(one)
        if not self._sent:
            return
        sent = {tag: one.softened(self._variance) for tag, one in self._sent.items()}
        for one in learning:
            others = _ExponentMessage()
            for tag, message in sent.items():
                others = others if tag == one.tag_id else others.plus(message)
            news = others.minus(self._received.get(one.tag_id, _ExponentMessage()))
            if abs(news.precision) < 1e-6:
                continue
            one.tracker.take_exponent(news.precision, news.weighted)
            self._received[one.tag_id] = others

    def _collect(self, belief: TagBelief) -> None:
        """Store a tag's path loss exponent if the tag exists, is located and fits the model."""
        if belief.existence_probability < _SHARING.existence or not belief.model_check().passed:
            return
        if belief.spread().rms_m > _SHARING.placed_m:
            return
        mean, variance = belief.tracker.exponent()
        prior = belief.prior
        known = 1.0 / prior.exponent_sigma**2
        before = _ExponentMessage(precision=known, weighted=known * prior.exponent)
        before = before.plus(self._received.get(belief.tag_id, _ExponentMessage()))
        precision = 1.0 / max(variance, 1e-6)
        own = _ExponentMessage(precision=precision, weighted=precision * mean).minus(before)
        if own.precision <= 0.0:
            return
        own = own.scaled(min(1.0, _SHARING.most_precision / own.precision))
        last = self._sent.get(belief.tag_id)
        if last is None or own.precision > _SHARING.news * last.precision:
            self._sent[belief.tag_id] = own
