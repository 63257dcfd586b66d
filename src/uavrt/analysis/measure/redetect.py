"""Search a flight's recording again, for new tags, another frequency window or a better
detector, and write the pulses with their poses as a new flight directory.
"""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from uavrt.analysis.inputs.flown_with import flight_settings
from uavrt.config.settings import AntennaSettings, DetectionSettings, Settings
from uavrt.core.messages import FlightInfo, Pulse, PulsePose, Tag
from uavrt.flight.flight_layout import new_flight_directory
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.pose.attacher import PoseAttacher
from uavrt.localization.pose.ring import PoseRing
from uavrt.radio.source import SampleSource


class FlightWriter:
    """Writes a flight from pulses detected again and the poses of the old flight."""

    def __init__(
        self,
        flight: Flight,
        source: SampleSource,
        tags: Sequence[Tag],
        directory: Path | None = None,
        searched: DetectionSettings | None = None,
    ) -> None:
        original = Path(flight.info.directory)
        if directory is None:
            directory = new_flight_directory(original.parent, flight.info.start_time_ns)
        self.directory = directory
        self._before = set(directory.iterdir()) if directory.is_dir() else set()
        settings = flight_settings(flight)
        antenna = AntennaSettings() if settings is None else settings.antenna
        if searched is not None:
            settings = _with_search(Settings() if settings is None else settings, searched)
        self._attacher = _attacher_of(flight, antenna)
        info = FlightInfo(
            directory=str(directory),
            start_time_ns=flight.info.start_time_ns,
            clock_offset_ns=flight.info.clock_offset_ns,
            center_frequency_hz=source.center_frequency_hz,
            sample_rate_hz=source.sample_rate_hz,
            tags=tuple(tags),
        )
        self._recorder = FlightRecorder.create(info, settings)
        self._copy(flight)
        note = f"detected again in a recording of {original.name}"
        self._recorder.write_note(note, flight.info.start_time_ns)
        self._recorder.commit()

    @property
    def with_pose(self) -> int:
        """Number of written pulses with a pose."""
        return self._attacher.attached + self._attacher.extrapolated

    @property
    def without_pose(self) -> int:
        """Number of pulses outside the time span of the poses; a high number means a wrong
        flight or start time.
        """
        return self._attacher.without_pose

    def write(self, pulses: Sequence[Pulse]) -> None:
        """Record pulses with their poses in the new flight."""
        for pulse in pulses:
            self._attacher.add(pulse, pulse.end_time_ns)
        self._recorder.write_pulses(self._attacher.flush())
        self._recorder.commit()

    def close(self) -> None:
        """Complete the new flight; raises `RecordingError` if the disk is full."""
        self._recorder.close()

    def discard(self) -> None:
        """Remove the new flight if no samples were searched, lest it count as a flight."""
        self._recorder.close()
        for path in set(self.directory.iterdir()) - self._before:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        if not self._before:
            self.directory.rmdir()

    def _copy(self, flight: Flight) -> None:
        for first in range(0, len(flight.poses), 1000):
            self._recorder.write(*flight.poses[first : first + 1000])
            self._recorder.commit()
        for time_ns, text in flight.status_texts:
            self._recorder.write_status_text(text, time_ns)
        for time_ns, note in flight.notes:
            self._recorder.write_note(note, time_ns)


def posed_in(flight: Flight, pulses: Sequence[Pulse]) -> tuple[PulsePose, ...]:
    """Add the antenna's poses in a flight to pulses; return them in order of time and tag.

    A pulse outside the time span of the flight gets no pose.
    """
    settings = flight_settings(flight)
    attacher = _attacher_of(flight, AntennaSettings() if settings is None else settings.antenna)
    for pulse in pulses:
        attacher.add(pulse, pulse.end_time_ns)
    found = attacher.flush()
    return tuple(sorted(found, key=lambda one: (one.pulse.start_time_ns, one.pulse.tag_id)))


def _attacher_of(flight: Flight, antenna: AntennaSettings) -> PoseAttacher:
    """Pose attacher with all poses of a flight, so that pulses wait for none."""
    ring = PoseRing(antenna, capacity=max(len(flight.poses), 1))
    for pose in flight.poses:
        ring.add_pose(pose)
    return PoseAttacher(ring, wait_s=0.0)


def _with_search(settings: Settings, searched: DetectionSettings) -> Settings:
    detection = replace(
        settings.detection,
        frequency_window_hz=searched.frequency_window_hz,
        operating_mode=searched.operating_mode,
    )
    return replace(settings, detection=detection)
