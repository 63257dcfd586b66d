"""Sum the signal of a whole flight by its phase in the pulse interval (folding), as arrays and
pictures.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from uavrt.analysis.whole_flights.judged_flights import IntegratedTag, chance_in_words
from uavrt.core.errors import RecordingError, os_errors_as
from uavrt.flight.integrated import FlightFold
from uavrt.localization.whole_flight.drifting import even_time_s
from uavrt.localization.whole_flight.flight_judgement import pulse_weights
from uavrt.localization.whole_flight.heard_train import limited_energies

_ROWS: Final = 32


def write_fold_pictures(directory: Path, results: Sequence[IntegratedTag]) -> list[Path]:
    """Write and return pictures of tags' folded signals, such as ``tag_2_fold.png``."""
    from uavrt.analysis.report.fold_page import draw_fold
    from uavrt.analysis.report.style import TAG_COLORS, new_figure, styled

    written = []
    with styled():
        for one in results:
            figure = new_figure(7.6, 5.2)
            verdict = "found" if one.found else "not found"
            chance = chance_in_words(one.train.false_alarm_probability, one.flights)
            figure.suptitle(
                f"Tag {one.tag.tag_id}: {verdict}, {chance}", size=10, x=0.02, ha="left"
            )
            draw_fold(figure, fold_of(one), TAG_COLORS[0])
            path = directory / f"tag_{one.tag.tag_id}_fold.png"
            with os_errors_as(
                RecordingError, f"cannot write {path}", "Name a writable directory"
            ):
                directory.mkdir(parents=True, exist_ok=True)
                figure.savefig(path, dpi=150)
            written.append(path)
    return written


def fold_of(one: IntegratedTag) -> FlightFold:
    """Sum pulse energies by phase in the tag's interval, limited and weighted as in the search,
    but with the pulses that are strong enough to be detected alone.
    """
    energies, pulses = one.energies, one.pulses
    row = int(np.argmin(np.abs(energies.offsets_hz - pulses.offset_hz)))
    columns = max(8, round(pulses.interval_s / energies.slot_s))
    span_s, drift = len(energies.heard) * energies.slot_s, one.train.drift
    first_s = even_time_s(pulses.time_s[:1], drift, span_s)
    time_s = even_time_s(energies.time_s, drift, span_s)
    turns = (time_s - float(first_s.sum())) / pulses.interval_s + 0.5
    number = np.floor(turns).astype(np.int64)
    number -= int(number.min())
    column = np.minimum((turns % 1.0 * columns).astype(np.int64), columns - 1)
    joined = max(1, -(-(int(number.max()) + 1) // _ROWS))
    gain = np.interp(energies.time_s, one.places.time_s, one.places.gain[best_place(one)])
    weight = pulse_weights(gain) * (energies.heard | energies.loud[row])
    energy = limited_energies(energies, row)
    shape = (int(number.max()) // joined + 1, columns)
    summed, squares = np.zeros(shape), np.zeros(shape)
    np.add.at(summed, (number // joined, column), weight * energy)
    np.add.at(squares, (number // joined, column), weight**2)
    profile = summed.sum(axis=0) / np.sqrt(np.maximum(squares.sum(axis=0), 1e-9))
    raster = summed / np.sqrt(np.maximum(squares, 1e-9))
    return FlightFold(
        tag_id=one.tag.tag_id,
        interval_s=pulses.interval_s,
        length_s=span_s,
        profile=tuple(np.round(profile, 2).tolist()),
        raster=tuple(map(tuple, np.round(raster, 2).tolist())),
    )


def best_place(one: IntegratedTag) -> int:
    """Index in `one.places` of the likeliest position, else of the strongest train."""
    if one.place is not None:
        return int(np.argmax(one.place.probability))
    return one.searched_place
