"""Analyse a flight in progress as a whole, from the radio channels recorded so far.

The method is that of `uavrt.analysis.whole_flights.judged_flights`. Pulse energies are computed
only once (`uavrt.localization.whole_flight.energies.growing`). Each repetition of the search
adds a chance of a false alarm. The k-th search therefore uses the probability p / (k (k + 1));
these sum to p (Boole's inequality).
"""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.inputs.flown_with import antenna_poses
from uavrt.analysis.integrated.hindsight import parts_of
from uavrt.analysis.whole_flights.judged_flights import (
    POSITION_M,
    IntegratedTag,
    WholeFlightOptions,
    chance_in_words,
    channel_samples,
    hills_under,
    judged_tag,
)
from uavrt.analysis.whole_flights.kept_samples import KeptChannel, channel_of, kept_channels
from uavrt.analysis.whole_flights.verdict_words import where_in_words
from uavrt.core.errors import FormatError
from uavrt.core.messages import Tag
from uavrt.dsp.frontend import FrontEnd
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.energies.growing import GrowingEnergies
from uavrt.planning.detectability.whole_flight_chance import MODEL
from uavrt.radio.files.joined import JoinedRecording
from uavrt.radio.files.sigmf import sigmf_layout


class FlightSoFar:
    """Searches a flight in progress for tags; its samples are in its `directory`."""

    def __init__(self, directory: Path, how: WholeFlightOptions) -> None:
        self._directory, self._how = directory, how
        self._heard: dict[int, _Heard] = {}

    def search(self, tag: Tag) -> IntegratedTag | None:
        """Search all samples so far for one tag; None if they are too few or none are new."""
        channel = channel_of(kept_channels(self._directory), tag)
        if channel is None:
            return None
        heard = self._heard.get(tag.tag_id)
        if heard is None or heard.channel_hz != channel.center_frequency_hz:
            heard = self._heard[tag.tag_id] = _Heard(
                tag, channel, self._how.frequency_window_hz
            )
        try:
            new = heard.listen(channel)
        except FormatError:  # its only piece has no samples yet
            return None
        if not new or heard.length_s < MODEL.least_pulses * tag.pulse_intervals_s[0]:
            return None
        flight = read_flight(self._directory)
        if len(flight.poses) < 2:
            return None
        heard.looks += 1
        chance = self._how.false_alarm_probability / (heard.looks * (heard.looks + 1))
        hills = hills_under(flight, self._how.elevation)
        return judged_tag(
            flight,
            tag,
            heard.energies(),
            PoseColumns.of(antenna_poses(flight)),
            replace(self._how, false_alarm_probability=chance),
            None if hills is None else hills.at(tag.frequency_hz),
        )


class _Heard:
    def __init__(self, tag: Tag, channel: KeptChannel, frequency_window_hz: float) -> None:
        self.channel_hz = channel.center_frequency_hz
        self.looks = 0
        self._tag, self._window_hz = tag, frequency_window_hz
        self._growing: GrowingEnergies | None = None

    @property
    def length_s(self) -> float:
        return 0.0 if self._growing is None else self._growing.length_s

    def listen(self, channel: KeptChannel) -> int:
        """Add a channel's new samples to the pulse energies; return the number of blocks."""
        growing = self._growing
        paths = channel.paths
        if growing is not None:
            paths = _reaching(paths, growing.needed_from_ns)
        with closing(JoinedRecording(paths)) as source:
            front_end = FrontEnd(
                sample_rate_hz=source.sample_rate_hz,
                center_frequency_hz=source.center_frequency_hz,
                frequencies_hz=[self._tag.frequency_hz],
            )
            plan = front_end.plan
            found: tuple[NDArray[np.complex64], NDArray[np.bool_], int]
            (found,) = channel_samples(source, front_end, None).values()
        samples, there, start_ns = found
        if not len(samples):
            return 0
        if growing is None:
            growing = self._growing = GrowingEnergies(
                self._tag,
                start_ns=start_ns,
                sample_rate_hz=plan.channel_rate_hz,
                center_frequency_hz=plan.channel_centers_hz[0],
                frequency_window_hz=self._window_hz,
                slots_per_pulse=1,
            )
        return growing.take(samples, there, start_ns)

    def energies(self) -> SlotEnergies:
        assert self._growing is not None
        return self._growing.energies()


def _reaching(paths: tuple[Path, ...], needed_ns: int) -> tuple[Path, ...]:
    starts: list[tuple[int, Path]] = []
    for path in paths:
        try:
            starts.append((sigmf_layout(path).segments[0].time_ns, path))
        except (FormatError, IndexError):  # removed meanwhile, or still empty
            continue
    starts.sort()
    later = [number for number, (start_ns, _) in enumerate(starts) if start_ns > needed_ns]
    first = max(0, (later[0] if later else len(starts)) - 1)
    return tuple(path for _, path in starts[first:])


def found_in_flight(one: IntegratedTag) -> str:
    """Return a status text of one line about a tag that was found in the flight in progress."""
    chance = chance_in_words(one.train.false_alarm_probability)
    place = one.place
    assert place is not None
    parts = parts_of(place)
    where = where_in_words(place, parts)[0 if place.radius95_m > POSITION_M else -1]
    if len(parts) > 1:
        where = f"in one of {len(parts)} places"
    return f"Tag {one.tag.tag_id} found over the flight so far, {where}; {chance}"
