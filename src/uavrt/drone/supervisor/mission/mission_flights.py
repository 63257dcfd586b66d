"""Begin, resume, correct and end flights and raw captures."""

import shutil
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from uavrt.config.parameters import tags_with_overrides, tuned_frequency, warnings_of_band
from uavrt.config.tags.code_rules import near_codes
from uavrt.core.clock import Clock, boot_id, wall_ns
from uavrt.core.commands import SystemState
from uavrt.core.errors import UavrtError
from uavrt.core.messages import FlightInfo, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, counted
from uavrt.drone.supervisor.mission.flight_opening import last_written_ns, new_flight
from uavrt.drone.supervisor.mission.kept_parameters import SettingsInForce
from uavrt.drone.supervisor.mission.saved_state import SavedState
from uavrt.drone.supervisor.mission.search_planning import (
    UNMEASURED_TAGS,
    Tuning,
    TuningRequest,
)
from uavrt.drone.supervisor.mission.tag_upload import TagUpload, check_tag
from uavrt.link.tunnel.tag_lists import searched_text

LAST_FLIGHTS = 3
"""Number of ended flights whose last pulses are still recorded and sent."""
RESUME_WITHIN_S = 900.0
"""Age up to which a flight is resumed after the computer has restarted [s]. A battery change or
a brown-out in the air takes less; last week's flight is older."""
_MOST_PAIRS_LISTED = 3
"""Most pairs of similar codes named to the operator at a flight's start; the page shows all."""
_USABLE_HALF_BAND = 0.4
"""Largest usable distance from the radio's centre frequency, as a fraction of the sample
rate."""
_USUAL_WINDOW_HZ = 500.0
"""Largest search range on either side of a tag's frequency that always fits into one channel
[Hz]."""

Notify = Callable[[int, str], None]
Tuner = Callable[[TuningRequest], Tuning]


class Flights:
    """Begins, resumes and ends flights and raw captures; holds the present flight."""

    def __init__(
        self,
        settings: SettingsInForce,
        upload: TagUpload,
        *,
        notify: Notify,
        on_start: Callable[[FlightInfo], None],
        tuner: Tuner,
        check_free: Callable[[], None],
    ) -> None:
        self._settings, self._upload = settings, upload
        self._notify, self._on_start = notify, on_start
        self._ask_tuner, self._check_free = tuner, check_free
        self.clock = Clock.start()
        self.flight: FlightInfo | None = None
        self.last: deque[str] = deque(maxlen=LAST_FLIGHTS)
        """Directories of ended flights, newest last."""
        self.ending = False
        """True while a flight's last pulses are recorded; no flight can begin meanwhile."""

    def resume(self, saved: SavedState) -> SystemState | None:
        """Resume the flight that an earlier supervisor saved; return the new state or None.

        If the computer has not restarted, the flight continues with its clock. Otherwise a new
        flight with a new clock begins; see `RESUME_WITHIN_S`.
        """
        flight = saved.flight
        same_boot = saved.boot_id == boot_id()
        self.last.extend(d for d in saved.last_flights if same_boot or _recent(d))
        state = None
        if flight is not None and flight.capture_s is not None:
            goes_on = same_boot and saved.state is SystemState.CAPTURING
            state = self._continue_capture(flight, saved.clock_offset_ns if goes_on else None)
        if saved.state is SystemState.DETECTING and flight is not None:
            if same_boot:
                self.clock = Clock(saved.clock_offset_ns)
                state = self._continue(flight)
            elif _recent(flight.directory):
                state = self._try_new_flight(flight.center_frequency_hz)
        if flight is not None and flight != self.flight and _recent(flight.directory):
            self.last.append(flight.directory)
        return state

    def _continue(self, flight: FlightInfo) -> SystemState | None:
        if not Path(flight.directory).is_dir():
            return self._try_new_flight(flight.center_frequency_hz)
        self.flight = flight
        self._on_start(flight)
        words = counted(len(self._upload.tags), "tag")
        self._notify(4, f"Supervisor restarted: detecting {words} again")
        return SystemState.DETECTING

    def _continue_capture(
        self, flight: FlightInfo, clock_offset_ns: int | None
    ) -> SystemState | None:
        """Continue a raw capture and return the state.

        If that is impossible, report where the recording is and return None.
        """
        if clock_offset_ns is None or not Path(flight.directory).is_dir():
            self._notify(4, f"Raw capture ended by a restart: kept in {flight.directory}")
            return None
        self.clock = Clock(clock_offset_ns)
        self.flight = flight
        self._on_start(flight)
        self._notify(4, "Supervisor restarted: recording the rest of the capture")
        return SystemState.CAPTURING

    def _try_new_flight(self, center_frequency_hz: float) -> SystemState | None:
        try:
            self.begin(center_frequency_hz)
        except UavrtError as error:
            self._notify(3, f"Supervisor restarted, but cannot detect: {error}")
            return None
        words = counted(len(self._upload.tags), "tag")
        self._notify(4, f"Computer restarted: detecting {words} again")
        return SystemState.DETECTING

    def begin(self, center_frequency_hz: float | None) -> FlightInfo:
        """Begin a flight, at the given, the configured or a computed radio frequency [Hz]."""
        self._check_free()
        settings = self._settings.now
        tags = tags_with_overrides(settings, self._upload.tags.values())
        for tag in tags:
            check_tag(tag)
        radio = settings.radio
        warnings: tuple[str, ...] = ()
        center_hz = center_frequency_hz or radio.center_frequency_hz
        if center_hz is not None:
            warnings = warnings_of_band(tags, center_hz, radio.sample_rate_hz)
        detection = settings.detection
        plain = detection.frequency_window_hz <= _USUAL_WINDOW_HZ
        if center_hz is None or not plain or len(tags) > UNMEASURED_TAGS:
            tuning = self._ask_tuner(self._tuning_request(tags, center_hz))
            center_hz, warnings = tuning.center_frequency_hz, warnings + tuning.warnings
        center_hz = tuned_frequency(radio, center_hz)
        flight = self._open(tags, center_hz)
        words = counted(len(self._upload.tags), "tag")
        self._notify(6, f"Detecting {words} at {center_hz:.0f} Hz")
        for warning in (*warnings, *self._near_code_texts(tags)):
            self._notify(5, warning)
        return flight

    def _near_code_texts(self, tags: Sequence[Tag]) -> list[str]:
        window_hz = self._settings.now.detection.frequency_window_hz
        pairs = [(one.tag_id, two.tag_id) for one, two, _ in near_codes(tags, window_hz)]
        words = [
            f"Codes {one}, {two} are easily confused" for one, two in pairs[:_MOST_PAIRS_LISTED]
        ]
        if len(pairs) > _MOST_PAIRS_LISTED:
            words.append(
                f"{len(pairs) - _MOST_PAIRS_LISTED} more pairs of codes are as similar"
            )
        return words

    def begin_capture(self, center_frequency_hz: float | None) -> FlightInfo:
        """Begin a raw capture, at the given, the configured or a computed frequency [Hz]."""
        self._check_free()
        settings = self._settings.now
        radio, recording = settings.radio, settings.recording
        center_hz = center_frequency_hz or radio.center_frequency_hz
        if center_hz is None and not self._upload.tags:
            raise UavrtError(
                "the radio frequency is unknown: send tags first, or set RADIO_FREQ_KHZ"
            )
        if center_hz is None:
            question = self._tuning_request(tuple(self._upload.tags.values()), None)
            center_hz = self._ask_tuner(question).center_frequency_hz
        center_hz = tuned_frequency(radio, center_hz)
        with suppress(OSError):
            free_mb = shutil.disk_usage(recording.directory).free / 1e6
            if free_mb < recording.minimum_free_mb:
                raise UavrtError(
                    f"the disk is nearly full, with {free_mb:.0f} MB free: clean the logs"
                )
        flight = self._open((), center_hz, recording.capture_s)
        self._notify(6, f"Capturing {recording.capture_s:g} s at {center_hz:.0f} Hz")
        return flight

    def _open(
        self, tags: tuple[Tag, ...], center_hz: float, capture_s: float | None = None
    ) -> FlightInfo:
        self.clock = Clock.start()
        self._settings.begin_flight()
        self.flight = new_flight(
            self._settings.now,
            tags,
            self.clock,
            center_frequency_hz=center_hz,
            capture_s=capture_s,
        )
        self._on_start(self.flight)
        return self.flight

    def _tuning_request(self, tags: tuple[Tag, ...], center_hz: float | None) -> TuningRequest:
        detection = (self._settings.in_flight if self.flight else self._settings.now).detection
        measured = len(tags) > UNMEASURED_TAGS and not detection.maximum_tags
        return TuningRequest(
            tags=tags,
            sample_rate_hz=self._settings.now.radio.sample_rate_hz,
            detection=detection,
            center_frequency_hz=center_hz,
            spare_cores=detection.worker_count if measured else None,
        )

    def correct(self, tag: Tag | None) -> tuple[FlightInfo, str, tuple[str, ...]] | None:
        """Change a tag's frequency or interval in the present flight.

        Returns the flight, a text and warnings; None if nothing changed.
        """
        flight, listed = self.flight, self._upload.tags
        known = None if tag is None else listed.get(tag.tag_id)
        if tag is None or known is None or flight is None:
            raise UavrtError(f"detecting {searched_text(listed.values())}: send stop first")
        tag = replace(tag, name=known.name)
        if tag == known:
            return None
        check_tag(tag)
        if known.coded or tag.coded:
            raise UavrtError("coded tags cannot be corrected in flight: send stop first")
        center_hz = flight.center_frequency_hz
        reach_hz = max(abs(one.frequency_hz - center_hz) for one in flight.tags)
        reach_hz = max(reach_hz, _USABLE_HALF_BAND * flight.sample_rate_hz)
        if abs(tag.frequency_hz - center_hz) > reach_hz:
            raise UavrtError(
                f"the radio at {center_hz / 1e6:.6f} MHz cannot receive tag {tag.tag_id}: "
                "send stop first"
            )
        settings = self._settings.in_flight
        (searched,) = tags_with_overrides(settings, (tag,))
        tags = tuple(searched if one.tag_id == tag.tag_id else one for one in flight.tags)
        warnings: tuple[str, ...] = ()
        if settings.detection.frequency_window_hz > _USUAL_WINDOW_HZ:
            # What the search costs was measured at the start, when the computer was not busy.
            question = replace(self._tuning_request(tags, center_hz), spare_cores=None)
            warnings = self._ask_tuner(question).warnings
        self._upload.correct(tag)
        self.flight = replace(flight, tags=tags)
        words = f"{tag.frequency_hz / 1e6:.6f} MHz, was {known.frequency_hz / 1e6:.6f}"
        if tag.frequency_hz == known.frequency_hz:
            before_s, now_s = known.pulse_intervals_s[-1], tag.pulse_intervals_s[-1]
            words = f"{1e3 * now_s:.0f} ms, was {1e3 * before_s:.0f}"
        return self.flight, words, warnings

    def mark_ending(self) -> str:
        """Note that the flight is ending; return its directory, ``""`` without a flight."""
        self.ending = True
        return self.flight.directory if self.flight else ""

    def ended(self) -> FlightInfo | None:
        """End the present flight, once its last pulse is recorded; return it, or None."""
        flight, self.flight = self.flight, None
        if flight is not None:
            self.last.append(flight.directory)
        self.ending = False
        return flight


def _recent(directory: str) -> bool:
    written_ns = last_written_ns(Path(directory))
    # A computer without a battery-backed clock may start in the past: that is recent too.
    return (
        written_ns is not None
        and wall_ns() - written_ns < RESUME_WITHIN_S * NANOSECONDS_PER_SECOND
    )
