"""Record a flight's channel samples within the receiver process."""

from collections.abc import Mapping
from pathlib import Path

from uavrt.core.messages import ChannelBlock, FlightInfo
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.flight.samples.channel_recorder import ChannelRecorder


class KeptChannels:
    """Records channel samples if the settings say so, and reports dropped samples."""

    def __init__(
        self, frame: ProcessFrame, flight: FlightInfo, *, switched_on: bool = True
    ) -> None:
        self._notify = frame.notify
        self._drop_reported = self._ring_reported = False
        self._recorder: ChannelRecorder | None = None
        settings = frame.assignment.settings
        self._budget_mb = settings.recording.channels_mb
        if settings.recording.channels and switched_on:
            self._recorder = ChannelRecorder(
                Path(flight.directory),
                budget_mb=self._budget_mb,
                minimum_free_mb=settings.recording.minimum_free_mb,
                hardware=settings.radio.kind,
            )

    def put(self, channels: list[ChannelBlock]) -> None:
        """Queue the channel blocks of a radio block for writing; never wait for the disk."""
        if self._recorder is not None and channels:
            self._recorder.put(channels)
            self._report_once(self._recorder)

    def _report_once(self, recorder: ChannelRecorder) -> None:
        if recorder.dropped_samples and not self._drop_reported:
            self._drop_reported = True
            self._notify(5, "Disk: channel samples dropped. Detection goes on")
        if recorder.removed_pieces and not self._ring_reported:
            self._ring_reported = True
            self._notify(
                6, f"Channel recordings: {self._budget_mb:.0f} MB used, oldest are removed"
            )

    def close(self) -> None:
        """Write the queued samples and close the files."""
        if self._recorder is not None:
            self._recorder.close()

    def counters(self) -> Mapping[str, float]:
        """Numbers of samples stored, dropped and removed, for the health report."""
        recorder = self._recorder
        if recorder is None:
            return {}
        return {
            "kept_samples": recorder.written_samples,
            "kept_samples_dropped": recorder.dropped_samples,
            "kept_values_invalid": recorder.invalid_values,
            "kept_pieces_removed": recorder.removed_pieces,
            "kept_mb": recorder.kept_mb,
        }
