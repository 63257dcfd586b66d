"""Measure time, frequency and strength of a coded burst, and create its record."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import Pulse, SearchReport, Tag
from uavrt.core.units import db_from_power, ns_from_s
from uavrt.detection.coded.code_judging import Burst
from uavrt.detection.coded.code_tracks import Tracks
from uavrt.detection.coded.identity import MeasuredBurst, Sighting
from uavrt.detection.coded.slot_cells import Cells
from uavrt.detection.coded.tuning import IDENTITY
from uavrt.detection.reporting import report_every_s
from uavrt.detection.signal.sample_buffer import Counters


class BurstReporter:
    """Creates one record for each burst of a coded tag; adds confirmed bursts to `tracks`."""

    def __init__(
        self,
        tracks: Tracks,
        *,
        sample_rate_hz: float,
        center_frequency_hz: float,
        counters: Counters,
    ) -> None:
        self._tracks, self._counters = tracks, counters
        self._sample_rate_hz = sample_rate_hz
        self._center_frequency_hz = center_frequency_hz
        self._sequence = dict.fromkeys(tracks.tags, 0)
        self._burst_times_ns: dict[int, list[int]] = {tag_id: [] for tag_id in tracks.tags}
        self._pulses: list[Pulse] = []
        self._reports: list[SearchReport] = []
        self._reported_ns = 0

    def drain(self) -> list[Pulse]:
        """Return the burst records since the last call, in order of time."""
        found, self._pulses = self._pulses, []
        return sorted(found, key=lambda pulse: pulse.start_time_ns)

    def drain_reports(self) -> list[SearchReport]:
        """Return the search reports since the last call."""
        reports, self._reports = self._reports, []
        return reports

    def burst(
        self,
        tag: Tag,
        measured: MeasuredBurst,
        *,
        confirmed: bool,
        others: tuple[int, ...],
    ) -> None:
        """Report a burst once; `others` are the ids of other tags that may have sent it."""
        start_ns, energies = measured.start_ns, measured.energies
        reported = self._burst_times_ns[tag.tag_id]
        if any(abs(start_ns - other) < ns_from_s(IDENTITY.same_burst_s) for other in reported):
            return
        reported.append(start_ns)
        del reported[:-64]
        track = self._tracks.add(tag.tag_id, start_ns, measured.row) if confirmed else None
        interval_s = tag.pulse_intervals_s[0] if track is None else track.interval_s
        error_s = tag.interval_uncertainty_s if track is None else track.error_s
        self._sequence[tag.tag_id] += 1
        self._counters.pulses += 1
        self._counters.groups += 1
        snr_db = db_from_power(float(energies.mean()))
        next_ns = start_ns + ns_from_s(interval_s)
        length_ns = ns_from_s(tag.length_s)
        self._pulses.append(
            Pulse(
                tag_id=tag.tag_id,
                frequency_hz=self._center_frequency_hz + measured.offset_hz,
                start_time_ns=start_ns,
                end_time_ns=start_ns + length_ns,
                snr_db=snr_db,
                group_snr_db=snr_db,
                score=measured.score,
                group_index=1,
                group_sequence=self._sequence[tag.tag_id],
                noise_psd=measured.noise / self._sample_rate_hz,
                detection_status="confirmed" if confirmed else "detected",
                confirmed=confirmed,
                rate=1,
                predicted_next_start_ns=next_ns - ns_from_s(error_s),
                predicted_next_end_ns=next_ns + ns_from_s(error_s) + length_ns,
                also_possible_tag_ids=others,
                burst_starts_ns=tuple(measured.starts_ns),
                burst_snrs_db=tuple(db_from_power(float(one)) for one in energies),
            )
        )

    def searched(self, now_ns: int, cells: Cells) -> None:
        """Create a search report for each tag once a second, or less often with many codes."""
        if now_ns - self._reported_ns < ns_from_s(report_every_s(len(self._tracks.tags))):
            return
        self._reported_ns = now_ns
        noise = float(np.median(cells.noise)) / self._sample_rate_hz
        self._reports += [
            SearchReport(
                tag_id=tag.tag_id,
                time_ns=now_ns,
                frequency_hz=tag.frequency_hz,
                noise_psd=noise,
                best_score=0.0,
            )
            for tag in self._tracks.tags.values()
        ]
        del self._reports[:-3600]


def sighting_of(
    burst: Burst,
    cells: Cells,
    *,
    time_ns: Callable[[float], int],
    width_s: float,
    tags: Mapping[int, Tag],
    required: float,
) -> Sighting:
    """Measure a burst's time, frequency and pulse energies; `width_s`: pulse width [s]."""
    good = burst.good
    tag = burst.book.tags[burst.code]
    columns = burst.columns[good]
    offsets = burst.offsets[good] - burst.offsets[0]
    places = columns + _offsets(cells, burst.row, columns)
    start = float(np.mean(places - offsets))
    energies = _energies(cells, burst.row, start + offsets)
    offset_hz, gained = _frequency(cells, burst.row, columns, width_s)
    alternatives = [tags[tag_id] for tag_id in burst.also_possible]
    return Sighting(
        tags=(tag, *alternatives),
        hit=tuple(burst.hit_by),
        start_ns=time_ns(start),
        starts_ns=[time_ns(place) for place in places.tolist()],
        energies=np.maximum(energies * gained - 1.0, 0.05),
        offset_hz=offset_hz,
        noise=float(cells.noise[burst.row]),
        row=burst.row,
        score=burst.score,
        alone=burst.alone,
        good=good,
        unlisted=burst.unlisted,
        required=required,
    )


def _offsets(cells: Cells, row: int, columns: NDArray[np.intp]) -> NDArray[np.float64]:
    """Distance from the column with a pulse's largest cell to the pulse's true peak [columns].

    The filter's response to a rectangular pulse falls linearly on both sides of the peak, so
    the amplitudes on both sides give the distance.
    """
    at = columns - cells.recent_from
    reach = max(1, cells.pulse // 3)
    left = np.sqrt(cells.recent[row, np.maximum(at - reach, 0)])
    right = np.sqrt(cells.recent[row, np.minimum(at + reach, cells.recent.shape[1] - 1)])
    top = np.sqrt(np.maximum(cells.recent[row, at], 1e-6))
    shift: NDArray[np.float64] = 0.5 * cells.pulse * (right - left) / top
    return shift.clip(-1.0, 1.0)


def _energies(cells: Cells, row: int, places: NDArray[np.float64]) -> NDArray[np.float64]:
    near = np.rint(places).astype(np.intp)
    lost = 1.0 - np.abs(places - near) / cells.pulse
    at = np.clip(near - cells.recent_from, 0, cells.recent.shape[1] - 1)
    energies: NDArray[np.float64] = cells.recent[row, at] / lost**2
    return energies


def _frequency(
    cells: Cells, row: int, columns: NDArray[np.intp], width_s: float
) -> tuple[float, float]:
    """Frequency of a burst in the channel [Hz], and factor for energy lost between rows."""
    rows = len(cells.offsets_hz)
    if rows < 3:
        return float(cells.offsets_hz[row]), 1.0
    middle = min(max(row, 1), rows - 2)
    at = columns - cells.recent_from
    low, top, high = cells.recent[middle - 1 : middle + 2, at].sum(axis=1).tolist()
    bend = low - 2.0 * top + high
    shift = 0.0 if bend >= 0.0 else min(1.0, max(-1.0, 0.5 * (low - high) / bend))
    spacing_hz = float(cells.offsets_hz[1] - cells.offsets_hz[0])
    offset_hz = float(cells.offsets_hz[middle]) + shift * spacing_hz
    away = float(np.sinc((offset_hz - float(cells.offsets_hz[row])) * width_s))
    return offset_hz, 1.0 / max(away**2, 0.5)
