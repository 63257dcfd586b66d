"""Raw capture: record the radio's band for a set time, instead of detecting pulses.

The capture runs in the receiver process, in place of the receiver.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from uavrt.config.settings import RadioSettings
from uavrt.core.messages import FlightInfo, IQBlock
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.dsp.frontend import FrontEnd
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.samples.iq_recorder import IQRecorder
from uavrt.flight.samples.sample_file import BYTES_PER_SAMPLE
from uavrt.radio.sanity import SampleCheck


class Capture:
    """Records the decimated band up to a set duration.

    Raises `RecordingError` if the recording cannot start.
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
        self._rate_hz = self._front_end.plan.band_rate_hz
        self._capture_s = flight.capture_s
        self._taken = 0
        self._lost = 0
        self._check = SampleCheck("the radio")
        directory = FlightLayout(Path(flight.directory)).iq_directory
        earlier = sorted(directory.glob("capture_*.sigmf-data"))
        # A receiver that was killed has left these: this one records the rest.
        self._earlier = sum(file.stat().st_size for file in earlier) // BYTES_PER_SAMPLE
        self._recorder = IQRecorder(
            directory / f"capture_{len(earlier) + 1}",
            center_frequency_hz=flight.center_frequency_hz,
            sample_rate_hz=self._rate_hz,
            minimum_free_mb=settings.recording.minimum_free_mb,
            description="Raw capture of the receiver's band",
            hardware=settings.radio.kind,
        )
        self._files = [*earlier, self._recorder.file.data_path]
        self._wanted = max(0, round(self._capture_s * self._rate_hz) - self._earlier)
        self._why = ""
        if self._recorder.room_samples < self._wanted:
            self._wanted = self._recorder.room_samples
            self._why = "the disk is nearly full"
            fits_s = (self._earlier + self._wanted) / self._rate_hz
            frame.notify(
                4, f"Disk: {fits_s:.0f} of {self._capture_s:g} s fit, the capture ends early"
            )

    @property
    def status(self) -> str | None:
        """Final status, ``captured`` or ``not captured``; None while the capture runs."""
        if self._taken < self._wanted and self._recorder.trouble is None:
            return None
        self._why = self._recorder.trouble or self._why
        self._recorder.close()
        return "captured" if self.status_text() else "not captured"

    def status_text(self) -> str:
        """Text on the recorded samples, with the reason if there are too few; empty if none."""
        recorded = self._earlier + self._recorder.written_samples
        if not recorded:
            return ""
        where = self._files[0] if len(self._files) == 1 else self._files[0].parent
        parts = "" if len(self._files) == 1 else f", {len(self._files)} files"
        why = f": {self._why}" if self._why else ""
        seconds = recorded / self._rate_hz
        return f"{seconds:.1f} of {self._capture_s:g} s in {where}{parts}{why}"

    def process(self, block: IQBlock) -> None:
        """Decimate and record a block; drop samples after the set duration."""
        band = self._front_end.decimate(block)
        self._lost += block.lost_before
        self._check.check(band)
        room = self._wanted - self._taken
        if self.status is not None or not len(band.samples):
            return
        samples = np.asarray(band.samples[:room])
        # If the disk is too slow, later samples make up for those that it refused.
        if self._recorder.put(replace(band, samples=samples)):
            self._taken += len(samples)

    def flush(self) -> None:
        """Do nothing; a capture keeps no samples in a queue."""

    def restart_filters(self, *, failed: bool = True) -> None:
        """Restart the decimation filter after a gap in the samples."""
        self.failures += failed
        self._front_end.reset()
        self._check = SampleCheck("the radio")

    def close(self) -> None:
        """Close the recording."""
        self._recorder.close()

    def counters(self) -> Mapping[str, float]:
        """Numbers of samples recorded and lost, for the health report."""
        return {
            "samples_lost": self._lost,
            "radio_failures": self.failures,
            "recording_samples": self._recorder.written_samples,
            "recording_samples_dropped": self._recorder.dropped_samples,
        }
