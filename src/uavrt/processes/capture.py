"""A raw capture: the decimated band of the radio to a file, for a while. Nothing is detected.

Runs in the receiver process, in place of the receiver.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from uavrt.config import RadioSettings
from uavrt.dsp import FrontEnd
from uavrt.ipc import ProcessFrame
from uavrt.messages import FlightInfo, IQBlock
from uavrt.radio import SampleCheck
from uavrt.recording import FlightLayout, IQRecorder


class Capture:
    """Decimates and records until there is enough.

    Parameters
    ----------
    frame : ProcessFrame
        The process.
    flight : FlightInfo
        The capture: where, at which frequency, how long.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """

    def __init__(self, frame: ProcessFrame, flight: FlightInfo) -> None:
        assert flight.capture_s is not None
        settings = frame.assignment.settings
        self.radio: RadioSettings = settings.radio
        self.failures = 0
        self._front_end = FrontEnd(
            sample_rate_hz=flight.sample_rate_hz,
            center_frequency_hz=flight.center_frequency_hz,
            frequencies_hz=[flight.center_frequency_hz],
        )
        band_rate_hz = self._front_end.plan.band_rate_hz
        self._wanted = round(flight.capture_s * band_rate_hz)
        self._taken = 0
        self._lost = 0
        self._check = SampleCheck("the radio")
        directory = FlightLayout(Path(flight.directory)).iq_directory
        number = 1 + sum(1 for _ in directory.glob("capture_*.sigmf-data"))
        self._recorder = IQRecorder(
            directory / f"capture_{number}",
            center_frequency_hz=flight.center_frequency_hz,
            sample_rate_hz=band_rate_hz,
            minimum_free_mb=settings.recording.minimum_free_mb,
            hardware=settings.radio.kind,
        )

    @property
    def status(self) -> str | None:
        """Word for the supervisor when it is over; None before."""
        if self._taken < self._wanted:
            return None
        self._recorder.close()
        return "captured" if self._recorder.written_samples >= self._wanted else "not captured"

    def process(self, block: IQBlock) -> None:
        """Decimate and record; what is beyond the wanted length is left out."""
        band = self._front_end.decimate(block)
        self._lost += block.lost_before
        self._check.look(band)
        room = self._wanted - self._taken
        if room <= 0 or not len(band.samples):
            return
        samples = np.asarray(band.samples[:room])
        self._taken += len(samples)
        self._recorder.put(
            IQBlock(
                samples=samples,
                sample_index=band.sample_index,
                time_ns=band.time_ns,
                sample_rate_hz=band.sample_rate_hz,
                lost_before=band.lost_before,
            )
        )

    def flush(self) -> None:
        """Nothing waits here."""

    def forget(self, *, failed: bool = True) -> None:
        """Restart the filter: what comes next does not continue what was."""
        self.failures += failed
        self._front_end.reset()
        self._check = SampleCheck("the radio")

    def close(self) -> None:
        """Finish the file."""
        self._recorder.close()

    def counters(self) -> Mapping[str, float]:
        """Count what was recorded and lost."""
        return {
            "samples_lost": self._lost,
            "radio_failures": self.failures,
            "recording_samples": self._recorder.written_samples,
            "recording_samples_dropped": self._recorder.dropped_samples,
        }
