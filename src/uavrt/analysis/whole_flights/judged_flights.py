"""Search whole flights for tags that are too weak for single groups of pulses, as in ``uavrt
integrate``.

The inputs are a recording of the band or of a channel, and the poses of the flight. Each tag is
found or not found, at a given probability of a false alarm in the flight. For a tag that is
found, interval, frequency, pulses and position are estimated.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.inputs.flown_with import antenna_poses
from uavrt.analysis.inputs.listening_times import limits_of, with_poses
from uavrt.core.errors import ConfigError, FormatError, RecordingError
from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.dsp.frontend import FrontEnd
from uavrt.flight.integrated import SearchedFor
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.estimates.heard import FlightGround, PoseColumns
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.whole_flight.energies.energy_grid import (
    SlotEnergies,
    gather,
    slot_energies,
)
from uavrt.localization.whole_flight.flight_judgement import FoldedTrain, pulse_weights
from uavrt.localization.whole_flight.heard_train import HeardTrain, TrainPulses, train_pulses
from uavrt.localization.whole_flight.tag_places import Places, distinct, places_around
from uavrt.localization.whole_flight.train_judging import OtherTrain, judge
from uavrt.localization.whole_flight.train_place import PlaceBelief, place_belief
from uavrt.planning.detectability.whole_flight_chance import MODEL
from uavrt.radio.source import SampleSource

POSITION_M = 2000.0
"""Radius of a tag's 95 % circle above which only a bearing is reported [m]."""
LEAST_PART = 0.05
"""Probability from which one of several possible tag positions is listed."""
_POLL_S = 0.5
_MOST_CHANNELS = 8
"""Maximum number of recorded channels in memory; ten minutes of one take 36 MB."""

Channel = tuple[NDArray[np.complex64], NDArray[np.bool_], int]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class IntegratedTag:
    """Whole-flight result for one tag, with the data from which it was computed."""

    tag: Tag
    found: bool
    train: FoldedTrain
    pulses: TrainPulses
    place: PlaceBelief | None
    energies: SlotEnergies
    places: Places
    searched_place: int
    """Index in `places` of the candidate position that gave the strongest pulse train."""
    others: tuple[OtherTrain, ...]
    """Pulse trains at the tag's frequency whose intervals contradict the tag list."""
    heard_alone: int
    """Number of this tag's confirmed pulses in the flight's own log."""
    flights: int = 1
    limitations: tuple[str, ...] = ()
    """Sentences on conditions that limit the validity of this tag's results."""
    searched: SearchedFor

    @property
    def remarks(self) -> tuple[str, ...]:
        """The limitations, and whether the tag rested."""
        return (*self.limitations, *rest_in_words(self.place))

    @property
    def ambiguous(self) -> OtherTrain | None:
        """Pulse train that may be this tag's, for example at 3/2 of its interval; None if the
        tag was found or no train fits.
        """
        if self.found:
            return None
        return next((one for one in self.others if one.ratio is not None), None)

    @property
    def pulse_times_ns(self) -> NDArray[np.int64]:
        """Start times of the train's pulses [ns, UTC], shape (n,), accurate to the jitter and
        the time slot.
        """
        since_ns = self.pulses.time_s * NANOSECONDS_PER_SECOND
        return np.asarray(self.energies.start_ns + np.rint(since_ns).astype(np.int64))


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeFlightOptions:
    """Settings of a whole-flight search."""

    pattern: AntennaPattern
    frequency_window_hz: float = 500.0
    """Half-width of the search around each tag's nominal frequency [Hz]."""
    false_alarm_probability: float = WHOLE_FLIGHT_FALSE_ALARM
    most_drift: float = 0.0
    """Largest searched relative change of the interval over the flight, up or down."""
    antenna_assumed: bool = False
    """True if the antenna is unknown and `pattern` assumed; results state this."""
    elevation: Elevation | None = None
    """Terrain heights, for the loss of pulses behind hills; None for level ground."""
    on_progress: Callable[[int, int | None], None] | None = None
    """Function called with the number of samples read so far, and their total."""
    on_tag: Callable[[int], None] | None = None
    """Function called with the number of tags searched so far."""


def integrate_flight(
    flight: Flight, source: SampleSource, tags: Sequence[Tag], how: WholeFlightOptions
) -> list[IntegratedTag]:
    """Search a whole flight's recording, which the caller closes, for each of several tags."""
    if not tags:
        raise ConfigError("there are no tags to search for", remedy="Name a tag file")
    if len(flight.poses) < 2:
        raise RecordingError(
            f"{flight.info.directory} has no poses",
            remedy="Name its samples together with an autopilot's log or a GPS track: uavrt "
            "integrate --recording FILE --track FILE --tags FILE",
        )
    poses = PoseColumns.of(antenna_poses(flight))
    hills = hills_under(flight, how.elevation)
    front_end = FrontEnd(
        sample_rate_hz=source.sample_rate_hz,
        center_frequency_hz=source.center_frequency_hz,
        frequencies_hz=[tag.frequency_hz for tag in tags],
    )
    plan = front_end.plan
    if len(plan.channels_in_use) > _MOST_CHANNELS:
        raise ConfigError(
            f"these tags need {len(plan.channels_in_use)} channels, but at most "
            f"{_MOST_CHANNELS} are held in memory at once",
            remedy="Name fewer tags with --tag, and repeat the command for the remaining tags",
        )
    faults: list[str] = []
    channels = channel_samples(source, front_end, how.on_progress, faults.append)
    centers_hz = dict(zip(plan.channels_in_use, plan.channel_centers_hz, strict=True))
    results = []
    for tag, channel in zip(tags, plan.frequency_channels, strict=True):
        samples, there, start_ns = channels[channel]
        seconds = len(samples) / plan.channel_rate_hz
        if seconds < MODEL.least_pulses * tag.pulse_intervals_s[0]:
            raise RecordingError(
                f"the recording is {seconds:.0f} s long, shorter than "
                f"{MODEL.least_pulses} pulse intervals of tag {tag.tag_id}",
                remedy="Use uavrt detect for short recordings",
            )
        if not samples.any():
            raise RecordingError(
                f"all samples of tag {tag.tag_id}'s channel are 0: the radio received nothing",
                remedy="Check the recording, and the radio's cable, antenna and gain",
            )
        window_hz, beyond = _window_held(
            tag, how.frequency_window_hz, centers_hz[channel], plan.channel_rate_hz
        )
        energies = slot_energies(
            samples,
            there,
            tag=tag,
            start_ns=start_ns,
            sample_rate_hz=plan.channel_rate_hz,
            center_frequency_hz=centers_hz[channel],
            frequency_window_hz=how.frequency_window_hz,
        )
        judged = judged_tag(
            flight,
            tag,
            energies,
            poses,
            replace(how, frequency_window_hz=window_hz),
            None if hills is None else hills.at(tag.frequency_hz),
        )
        results.append(replace(judged, limitations=(*judged.limitations, *beyond)))
        if how.on_tag is not None:
            how.on_tag(len(results))
    if not faults:
        return results
    return [replace(one, limitations=(*one.limitations, *faults)) for one in results]


def _window_held(
    tag: Tag, window_hz: float, center_hz: float, rate_hz: float
) -> tuple[float, tuple[str, ...]]:
    """Half-width to search around a tag [Hz], with a sentence if less than requested."""
    held_hz = max(0.0, 0.5 * rate_hz - abs(tag.frequency_hz - center_hz))
    if window_hz <= held_hz:
        return window_hz, ()
    return held_hz, (
        f"the channel contains only ± {held_hz:.0f} Hz around the tag's frequency: the rest of "
        f"--frequency-window {window_hz:g} was not searched",
    )


def searched_for(tag: Tag, how: WholeFlightOptions) -> SearchedFor:
    """Return the settings of a search for one tag, as they are saved with its result."""
    return SearchedFor(
        frequency_hz=tag.frequency_hz,
        pulse_width_s=tag.pulse_width_s,
        pulse_intervals_s=tag.pulse_intervals_s,
        interval_uncertainty_s=tag.interval_uncertainty_s,
        interval_jitter_s=tag.interval_jitter_s,
        gaps_s=tag.gaps_s,
        frequency_window_hz=how.frequency_window_hz,
        most_drift=how.most_drift,
        antenna=how.pattern.name,
        antenna_assumed=how.antenna_assumed,
    )


def judged_tag(
    flight: Flight,
    tag: Tag,
    energies: SlotEnergies,
    poses: PoseColumns,
    how: WholeFlightOptions,
    hills: HillLosses | None,
) -> IntegratedTag:
    """Search for one tag's pulse train, and locate the tag if found."""
    searched = searched_for(tag, how)
    places = places_around(
        poses, how.pattern, start_ns=energies.start_ns, end_ns=energies.end_ns, hills=hills
    )
    limitations = (
        *limits_of(energies, poses),
        *(() if hills is None else hills.cautions()),
        *assumed_in_words(searched),
    )
    energies = with_poses(energies, poses)
    chosen = distinct(pulse_weights(places.gain))
    judgement = judge(
        energies,
        places.gain[chosen],
        places.time_s,
        tag,
        false_alarm_probability=how.false_alarm_probability,
        most_drift=how.most_drift,
    )
    train, energies = judgement.train, judgement.energies
    pulses = train_pulses(energies, train, places.gain[chosen[train.place]], places.time_s)
    found = train.false_alarm_probability <= how.false_alarm_probability
    place = None
    if found:
        rates = len(tag.pulse_intervals_s)
        place = place_belief([HeardTrain.among(energies, pulses, places, rates=rates)])
    return IntegratedTag(
        tag=tag,
        found=found,
        train=train,
        pulses=pulses,
        place=place,
        energies=energies,
        places=places,
        searched_place=int(chosen[train.place]),
        others=judgement.others,
        heard_alone=sum(
            one.pulse.tag_id == tag.tag_id and one.pulse.confirmed for one in flight.pulse_poses
        ),
        limitations=limitations,
        searched=searched,
    )


def assumed_in_words(searched: SearchedFor) -> tuple[str, ...]:
    """Sentence that the antenna was assumed; empty if the flight or user specified it."""
    if not searched.antenna_assumed:
        return ()
    return (
        f"antenna not specified: {searched.antenna} assumed; "
        "pulses would be weighted differently with another antenna (give --antenna)",
    )


def rest_in_words(place: PlaceBelief | None) -> tuple[str, ...]:
    """Sentence on whether the tag of a position walked; empty without a position."""
    if place is None:
        return ()
    if place.walk is None:
        return ("the position assumes that the tag was at rest, which was not checked",)
    if place.walk.walked:
        return (place.walk.caution.text,)
    return (
        "the position assumes that the tag was at rest: the pulses show no walk, but a slow "
        "one may go unnoticed",
    )


def channel_samples(
    source: SampleSource,
    front_end: FrontEnd,
    on_progress: Callable[[int, int | None], None] | None,
    on_fault: Callable[[str], None] | None = None,
) -> dict[int, Channel]:
    """Read a recording, and return the samples of the front end's channels by channel number.

    With `on_fault`, a damaged recording is used up to the fault, and `on_fault` is called with
    its description.
    """
    blocks: dict[int, list[tuple[NDArray[np.complex64], int]]] = {
        channel: [] for channel in front_end.plan.channels_in_use
    }
    done = 0
    while True:
        try:
            block = source.read(_POLL_S)
        except EOFError:
            break
        except FormatError as error:
            if on_fault is None or not done:
                raise
            on_fault(f"{error.message}: only the samples before this fault were searched")
            break
        if block is None:
            continue
        with np.errstate(invalid="ignore", over="ignore"):
            for each in front_end.process(block):
                good = np.isfinite(each.samples)
                samples = np.where(good, each.samples, np.complex64(0.0))
                blocks[each.channel].append((samples, each.time_ns))
        done += len(block.samples)
        if on_progress is not None:
            on_progress(done, source.total_samples)
    rate_hz = front_end.plan.channel_rate_hz
    return {channel: gather(some, rate_hz) for channel, some in blocks.items()}


def hills_under(flight: Flight, elevation: Elevation | None) -> HillLosses | None:
    """Return the terrain below a flight, relative to its take-off; None for level ground."""
    if elevation is None:
        return None
    over = FlightGround.of(elevation, PoseColumns.of(flight.poses))
    return None if over is None else over.hills


def chance_in_words(probability: float, flights: int = 1) -> str:
    """Sentence on how often noise alone gives such a result, in one flight or several."""
    what = "flights" if flights == 1 else f"groups of {flights} flights"
    if probability >= 0.01:
        # 1.4 of 100 is not found at a limit of 1: rounded it would pass for found.
        share = f"{100.0 * probability:.{1 if probability < 0.1 else 0}f}"
        return f"noise alone gives such a result in {share.removesuffix('.0')} of 100 {what}"
    if probability < 1e-9:
        return f"noise alone gives such a result in fewer than one of a billion {what}"
    digits = max(0, math.floor(-math.log10(probability)))
    count = round(1.0 / probability, -digits)
    return f"noise alone gives such a result in one of {count:,.0f} {what}"
