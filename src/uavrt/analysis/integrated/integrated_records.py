"""Records of whole-flight results for a tag, as printed by ``uavrt integrate --json``."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.integrated.hindsight import PLACE_FIELDS, parts_of, rings_of, slots_of
from uavrt.analysis.whole_flights.judged_flights import IntegratedTag
from uavrt.core.clock import iso_utc
from uavrt.flight.integrated import IntegratedPart, Ring
from uavrt.localization.whole_flight.train_judging import OtherTrain
from uavrt.localization.whole_flight.train_place import PlaceBelief


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherTrainRecord:
    """Pulse train at a tag's frequency whose interval contradicts the tag's list entry."""

    interval_s: float
    frequency_hz: float
    ratio: str | None
    """Ratio of this pulse train's interval to the tag's, such as ``3/2``."""
    other_code: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotRecord:
    """One time slot of a pulse train, in which a pulse was expected, with its energy."""

    time: str
    """Start of the time slot, ISO 8601, UTC."""
    time_ns: int
    energy: float
    at_rate: bool
    """True if the tag probably sent at this train's rate; False if at its other rate."""
    stands_out: bool
    """True if noise alone reaches the slot's energy in at most one slot out of twenty."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceRecord:
    """Position of a tag; all fields are None if it was not found or moved between flights."""

    enr_db: float | None = None
    """Energy of the tag's strongest pulse divided by the noise density [dB]."""
    latitude_deg: float | None = None
    """Latitude of the tag [deg], or of the middle of several possible `places`."""
    longitude_deg: float | None = None
    radius50_m: float | None = None
    radius95_m: float | None = None
    level_db: float | None = None
    """Energy of the strongest pulse [dB], `enr_db` under the name of earlier versions."""
    bearing_deg: float | None = None
    arc50_deg: float | None = None
    arc95_deg: float | None = None
    places: tuple[IntegratedPart, ...] = ()
    region50: tuple[Ring, ...] = ()
    region95: tuple[Ring, ...] = ()
    walk_probability: float | None = None
    """Probability that the tag walked during the flight; None: not checked. Above 0.5 the
    position is that at the last pulse; otherwise the tag is assumed to rest."""

    @classmethod
    def of(cls, place: PlaceBelief | None) -> "PlaceRecord":
        """Convert a position estimate to a record."""
        if place is None:
            return cls()
        return cls(
            enr_db=place.level_db,
            **{name: getattr(place, name) for name in PLACE_FIELDS},
            places=parts_of(place, 0.0),
            region50=rings_of(place, 0.5),
            region95=rings_of(place, 0.95),
            walk_probability=None if place.walk is None else place.walk.probability,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SilenceRecord:
    """Summary of the map of where a tag that was not found would have been found."""

    tag_power_dbm: float
    whole_flight: bool
    """True if the map is of whole-flight analysis, False if of single pulse groups."""
    mean_probability: float | None
    """Mean probability of finding the tag, over the map; None if no terrain is known."""
    share50: float | None
    """Share of the map in which the tag would be found with a probability of at least 0.5."""
    share90: float | None
    sure_within_m: float | None
    """Distance from the flight within which the tag would be found everywhere with a
    probability of at least 0.9 [m]; None if nowhere."""
    noise: str
    """Sentence for the operator about the noise measurement on which the map is based."""
    antenna: str
    limitations: tuple[str, ...]
    files: tuple[str, ...]
    """Names of the map files, GeoTIFF and PNG; empty if none was saved."""

    @classmethod
    def of(cls, one: SilentMap, files: Sequence[Path]) -> "SilenceRecord":
        """Convert a coverage map to a record."""
        coverage = one.coverage
        return cls(
            tag_power_dbm=one.tag_power_dbm,
            whole_flight=coverage.whole_flight,
            mean_probability=_finite(coverage.mean),
            share50=_finite(coverage.share_above(0.5)),
            share90=_finite(coverage.share_above(0.9)),
            sure_within_m=one.around.within_m,
            noise=one.noise,
            antenna=one.antenna,
            limitations=coverage.limitations,
            files=tuple(map(str, files)),
        )


def _finite(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class IntegratedRecord(PlaceRecord):
    """Result of a whole flight for one tag."""

    tag_id: int
    found: bool
    false_alarm_probability: float
    """Probability that noise alone would give a result as strong as this one in a flight."""
    interval_s: float
    """Pulse interval of the train found or, if none, of the strongest candidate [s]."""
    frequency_hz: float
    pulses: int
    """Number of the tag's expected pulses while it was sending at this rate; 0 if not found."""
    score: float
    rate: int
    drift: float
    ambiguous: bool
    other_trains: tuple[OtherTrainRecord, ...]
    confirmed_alone: int
    antenna: str
    antenna_assumed: bool
    """True if an antenna was assumed because the flight records none."""
    limitations: tuple[str, ...]
    integrated_pulses: tuple[SlotRecord, ...]
    silence: SilenceRecord | None = None
    """Where the tag would have been found; None if it may have been received, or without a
    coverage map."""


def integrated_record(
    one: IntegratedTag, silence: SilenceRecord | None = None
) -> IntegratedRecord:
    """Convert a whole-flight result for one tag to the record that is printed as JSON."""
    slots = _slots(one) if one.found else ()
    place = PlaceRecord.of(one.place)
    return IntegratedRecord(
        **{name: getattr(place, name) for name in PlaceRecord.__dataclass_fields__},
        tag_id=one.tag.tag_id,
        found=one.found,
        false_alarm_probability=one.train.false_alarm_probability,
        interval_s=one.pulses.interval_s,
        frequency_hz=one.tag.frequency_hz + one.pulses.offset_hz,
        pulses=sum(slot.at_rate for slot in slots),
        score=one.train.score,
        rate=one.train.rate,
        drift=one.train.drift,
        ambiguous=one.ambiguous is not None,
        other_trains=tuple(_other(one, other) for other in one.others),
        confirmed_alone=one.heard_alone,
        antenna=one.searched.antenna,
        antenna_assumed=one.searched.antenna_assumed,
        limitations=one.remarks,
        integrated_pulses=slots,
        silence=silence,
    )


def _other(one: IntegratedTag, other: OtherTrain) -> OtherTrainRecord:
    return OtherTrainRecord(
        interval_s=other.interval_s,
        frequency_hz=one.tag.frequency_hz + other.offset_hz,
        ratio=None if other.ratio is None else "{}/{}".format(*other.ratio),
        other_code=other.other_code,
    )


def _slots(one: IntegratedTag) -> tuple[SlotRecord, ...]:
    slots = slots_of(one)
    return tuple(
        SlotRecord(
            time=iso_utc(int(time_ns)),
            time_ns=int(time_ns),
            energy=float(energy),
            at_rate=bool(at_rate),
            stands_out=bool(supported),
        )
        for time_ns, energy, at_rate, supported in zip(
            one.pulse_times_ns, one.pulses.energy, slots.at_rate, slots.supported, strict=True
        )
    )
