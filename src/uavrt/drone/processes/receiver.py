"""The receiver process: filters the radio's samples into one channel for each tag frequency.

The process decimates and channelizes, and sends each used channel to the detectors of its tags.
It records the channels' samples and, on request, the decimated band.
"""

import socket
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

from uavrt.config.ghost_places import Receiver as RadioBand
from uavrt.config.settings import Settings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RecordingError, UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Beep, BeepKind, ChannelBlock, FlightInfo, IQBlock, keep_beep
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.sample_datagrams import ChannelSender
from uavrt.drone.processes.samples.beep_listener import BeepListener
from uavrt.drone.processes.samples.capture import Capture
from uavrt.drone.processes.samples.kept_channels import KeptChannels
from uavrt.dsp.carriers import Carriers
from uavrt.dsp.clipping import Clipping
from uavrt.dsp.frontend import FrontEnd
from uavrt.dsp.input_check import InputCheck
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.samples.iq_recorder import IQRecorder
from uavrt.radio.channels.channel_output import ChannelOutput
from uavrt.radio.opening import open_radio
from uavrt.radio.receivers.devices import ambiguous_radios
from uavrt.radio.sanity import SampleCheck
from uavrt.radio.source import SampleSource

log = get_logger()

READ_TIMEOUT_S = 0.5
LOSS_REPORT_S = 0.1
"""Duration of lost samples from which the loss is reported to the ground [s]."""
RETRY_WINDOW_S = 10.0
"""Two failures of the radio within this time count as lasting [s]. The radio is then reopened
every `RadioSettings.retry_s`, not at once."""


CLIPPED_S = 0.1
"""Duration of clipped samples from which clipping is reported [s]: about five pulses."""


class ChannelSink(Protocol):
    """Consumer of channel samples: the socket to a detector process, or a detector itself."""

    samples_dropped: int

    def send(self, block: ChannelBlock) -> None:
        """Accept the next block of a channel."""

    def flush(self) -> None:
        """Complete a radio block: search its blocks, or send them with any that still wait."""


_RECORDED_AGAIN_S = 10.0


class Receiver:
    """Converts the radio's samples to channels for the detectors, and records them."""

    makes_channels = True
    """True if this process records the channels; a subclass may leave that to another one."""

    def __init__(
        self,
        frame: ProcessFrame,
        flight: FlightInfo,
        sinks: Sequence[ChannelSink] | None = None,
    ) -> None:
        assignment = frame.assignment
        self._sample_rate_hz = flight.sample_rate_hz
        self._front_end = FrontEnd(
            sample_rate_hz=flight.sample_rate_hz,
            center_frequency_hz=flight.center_frequency_hz,
            frequencies_hz=[tag.frequency_hz for tag in flight.tags],
        )
        self._sinks: Sequence[ChannelSink] = sinks or [
            ChannelSender(socket.socket(fileno=fd)) for fd in assignment.sample_fds
        ]
        self._workers_of_channel: dict[int, set[int]] = {}
        for tag in flight.tags:
            channel = self._front_end.channel_of(tag.frequency_hz)
            worker = assignment.worker_of_tag[tag.tag_id]
            self._workers_of_channel.setdefault(channel, set()).add(worker)
        self._recorder = self._open_recorder(frame, flight)
        self._kept = KeptChannels(frame, flight, switched_on=self.makes_channels)
        self._output = self._open_output(frame, flight)
        self._check = SampleCheck("the radio")
        self._clipping = Clipping()
        self._carriers = Carriers()
        self._input_check = InputCheck(flight.tags, flight.center_frequency_hz)
        self._beeps = BeepListener(
            partial(
                BeepSearch,
                flight.tags,
                assignment.settings.detection.frequency_window_hz,
                RadioBand(flight.center_frequency_hz, flight.sample_rate_hz),
                live=True,
            )
        )
        self._beeping: list[Beep] = []
        self._beeps_failed = False
        self._frame = frame
        self._clipping_reported = False
        self._trouble_after_s = 0.0
        self._notify = frame.notify
        self.radio = assignment.settings.radio
        self.center_frequency_hz = flight.center_frequency_hz
        self._reopened = False
        self.failures = 0
        self.samples = 0
        self.samples_lost = 0
        self.samples_unsure = 0
        """Number of samples that are lost, or seem lost because of a wrong sample rate."""
        self._next_loss_report_s = LOSS_REPORT_S
        self.first_sample_ns = 0
        self.last_sample_ns = 0

    def _open_recorder(self, frame: ProcessFrame, flight: FlightInfo) -> IQRecorder | None:
        recording = frame.assignment.settings.recording
        if not recording.iq:
            return None
        try:
            return IQRecorder(
                new_recording_name(FlightLayout(Path(flight.directory)).iq_directory),
                center_frequency_hz=flight.center_frequency_hz,
                sample_rate_hz=self._front_end.plan.band_rate_hz,
                minimum_free_mb=recording.minimum_free_mb,
                hardware=frame.assignment.settings.radio.kind,
            )
        except RecordingError as error:
            log.error("raw samples are not recorded; detection goes on", reason=str(error))
            return None

    def _open_output(self, frame: ProcessFrame, flight: FlightInfo) -> ChannelOutput | None:
        settings = frame.assignment.settings.udp_channels
        if not settings.enabled:
            return None
        try:
            output = ChannelOutput(
                settings,
                flight.tags,
                band_rate_hz=self._front_end.plan.band_rate_hz,
                center_frequency_hz=flight.center_frequency_hz,
            )
        except UavrtError as error:
            log.error("channels are not sent by UDP; detection goes on", reason=str(error))
            return None
        if output.left_out:
            log.warning(
                "more than 100 channels have tags: the remaining tags are not sent by UDP",
                count=output.left_out,
            )
        return output

    def process(self, block: IQBlock) -> None:
        """Decimate a block, split it into channels, and send and record these."""
        if self._reopened:
            self._reopened = False
            self.samples_lost += self._missed(block)
        self.samples += len(block.samples)
        self.samples_lost += block.lost_before - block.unsure_before
        self.samples_unsure += block.unsure_before
        self.first_sample_ns = self.first_sample_ns or block.time_ns
        self.last_sample_ns = block.time_ns + round(
            len(block.samples) * NANOSECONDS_PER_SECOND / block.sample_rate_hz
        )
        self._clipping.check(block)
        self._carriers.check(block, self.center_frequency_hz)
        self._report_clipping()
        for fault in self._input_check.check(block):
            self._notify(4, fault)
        band = self._front_end.decimate(block)
        self._check.check(band)
        if self._recorder is not None:
            self._recorder.put(band)
            if (trouble := self._recorder.trouble) is not None:
                kept_s = self._recorder.written_samples / self._front_end.plan.band_rate_hz
                if kept_s >= self._trouble_after_s:
                    self._notify(
                        4, f"Band no longer recorded: {trouble}. {kept_s:.0f} s are kept"
                    )
                self._trouble_after_s = kept_s + _RECORDED_AGAIN_S
        if self._output is not None:
            self._output.process(band)
        self._pass_on(band)
        self.flush()
        self._beeps.add(block, band)
        self._report_beeps()

    def _report_beeps(self) -> None:
        for beep in self._beeps.take_found():
            self._frame.send("beep", beep)
            if keep_beep(self._beeping, beep) and beep.odd:
                log.info("unlisted signal found", what=str(beep))
                if beep.tag_ids and beep.kind is not BeepKind.IMAGE:
                    self._notify(5, beep.meaning)
        if self._beeps.failed and not self._beeps_failed:
            self._beeps_failed = True
            self._notify(4, "Unlisted tags no longer searched: internal fault")

    def _missed(self, block: IQBlock) -> int:
        if not self.last_sample_ns:
            return 0
        missed_ns = block.time_ns - self.last_sample_ns
        return max(0, round(missed_ns * 1e-9 * self._sample_rate_hz) - block.lost_before)

    def _report_clipping(self) -> None:
        if self._clipping.clipped_s > CLIPPED_S and not self._clipping_reported:
            self._clipping_reported = True
            self._notify(4, "Radio clipped: SNR too low. Reduce gain")

    def _pass_on(self, band: IQBlock) -> None:
        channels = self._front_end.channelize(band)
        self._kept.put(channels)
        # The filters delay the channels against the radio: these do not wait for them.
        clipped_ns = self._clipping.take_new() if channels else ()
        carriers_hz = self._carriers.frequencies_hz
        for channel in channels:
            if clipped_ns or carriers_hz:
                channel = replace(channel, clipped_ns=clipped_ns, carriers_hz=carriers_hz)
            for worker in self._workers_of_channel[channel.channel]:
                self._sinks[worker].send(channel)

    def report_losses(self, frame: ProcessFrame) -> None:
        """Report lost samples to the ground: at 0.1 s, then whenever they have doubled."""
        lost_s = self.samples_lost / self._sample_rate_hz
        if lost_s < self._next_loss_report_s:
            return
        self._next_loss_report_s = 2.0 * lost_s
        share = self.samples_lost / max(self.samples + self.samples_lost, 1)
        frame.notify(
            4,
            f"The radio lost {lost_s:.1f} s of samples so far ({100.0 * share:.1f} %): pulses "
            "in them are missed. Check its USB cable and this computer's load",
        )

    def restart_filters(self, *, failed: bool = True) -> None:
        """Restart the filters after a gap in the samples.

        `failed` is True after a failure of the radio, False after a change of its settings.
        """
        self.failures += failed
        self._reopened = True
        self._front_end.reset()
        if self._output is not None:
            self._output.reset()
        self._check = SampleCheck("the radio")
        if not failed:  # its crystal's correction may be another
            self._beeps.begin_again()
            self._beeping.clear()

    def flush(self) -> None:
        """Complete a radio block: send its channel blocks and any that still wait."""
        for sink in self._sinks:
            sink.flush()

    def close(self) -> None:
        """Close all recordings, and end the search for unlisted senders."""
        self._beeps.close()
        self._report_beeps()
        self._kept.close()
        if self._recorder is not None:
            self._recorder.close()
        if self._output is not None:
            self._output.close()

    def counters(self) -> Mapping[str, float]:
        """Counts of samples received, lost and recorded, for the health report."""
        counters: dict[str, float] = {
            "samples": self.samples,
            "samples_lost": self.samples_lost,
            "samples_rate_or_loss": self.samples_unsure,
            "radio_failures": self.failures,
            # float64 holds a time of today to 0.3 µs.
            "first_sample_ns": float(self.first_sample_ns),
            "last_sample_ns": float(self.last_sample_ns),
            "clipped_s": self._clipping.clipped_s,
            "beeping": len(self._beeping),
            "beep_cells_dropped": self._beeps.cells_dropped,
            "beep_search_dropped_s": self._beeps.dropped_s,
            "channel_samples_dropped": sum(s.samples_dropped for s in self._sinks),
            **self._kept.counters(),
        }
        if self._recorder is not None:
            counters["recording_samples"] = self._recorder.written_samples
            counters["recording_samples_dropped"] = self._recorder.dropped_samples
        if self._output is not None:
            counters |= self._output.counters()
        return counters


def new_recording_name(directory: Path) -> Path:
    """Return an unused file name, without extension, so that a restart overwrites nothing."""
    number = 1
    while (directory / f"band_{number}.sigmf-data").exists():
        number += 1
    return directory / f"band_{number}"


def main() -> None:
    """Receive samples with a `Receiver` until stopped."""
    run(Receiver)


def run(kind: Callable[[ProcessFrame, FlightInfo], Receiver]) -> None:
    """Run the receiver that `kind` makes, or a capture; reopen the radio after each failure."""
    with ProcessFrame.start() as frame:
        flight = frame.assignment.flight
        if flight is None:
            raise UavrtError("the receiver was started without a flight")
        receiver: Receiver | Capture
        receiver = kind(frame, flight) if flight.capture_s is None else Capture(frame, flight)
        if (several := ambiguous_radios(receiver.radio)) is not None:
            frame.notify(4, f"{several[0]}. {several[1]}")
        last_failure_s, last_reason = -RETRY_WINDOW_S, ""
        try:
            while frame.running:
                try:
                    receive(frame, receiver, flight, last_reason)
                    last_reason = ""
                except (UavrtError, EOFError) as error:
                    again = monotonic_s() - last_failure_s < RETRY_WINDOW_S
                    delay_s = receiver.radio.retry_s if again else 0.0
                    last_failure_s = monotonic_s()
                    receiver.restart_filters()
                    reason = str(error) or "the stream ended"
                    if reason != last_reason or delay_s == 0.0:
                        log.warning("radio absent", reason=reason)
                    last_reason = reason
                    wait(frame, receiver, delay_s, reason)
        finally:
            receiver.close()
        status_text = receiver.status_text() if isinstance(receiver, Capture) else ""
        frame.report("stopped", counters=receiver.counters, last=True, reason=status_text)


def receive(
    frame: ProcessFrame, receiver: Receiver | Capture, flight: FlightInfo, last_reason: str
) -> None:
    """Process samples until the radio fails, its settings change, or the process is stopped."""
    radio = receiver.radio
    source: SampleSource = open_radio(radio, flight.center_frequency_hz, clock=frame.clock)
    flowing = False
    try:
        while frame.running and receiver.radio == radio:
            block = source.read(timeout_s=READ_TIMEOUT_S)
            if block is None:
                receiver.flush()
            else:
                receiver.process(block)
                if isinstance(receiver, Receiver):
                    receiver.report_losses(frame)
                if receiver.failures and not flowing:
                    frame.notify(5, "Radio delivers samples again")
                flowing = True
            take_settings(frame.receive(), receiver)
            if not flowing:
                _report(frame, receiver, "waiting for samples", last_reason)
            elif (fault := getattr(source, "rate_fault", None)) is not None:
                _report(frame, receiver, "receiving at another rate", fault)
            else:
                _report(frame, receiver, "receiving", "")
    finally:
        source.close()
    if frame.running:
        log.info("radio reopened", gain=receiver.radio.gain, bias_tee=receiver.radio.bias_tee)
        receiver.restart_filters(failed=False)


def _report(frame: ProcessFrame, receiver: Receiver | Capture, word: str, reason: str) -> None:
    if isinstance(receiver, Capture) and (over := receiver.status) is not None:
        frame.report(over, counters=receiver.counters, reason=receiver.status_text())
    else:
        frame.report(word, ok=not reason, counters=receiver.counters, reason=reason)


def take_settings(records: Iterable[tuple[str, object]], receiver: Receiver | Capture) -> None:
    """Apply changed radio settings by reopening the radio at the present frequency.

    Reopening is necessary because the radio programs read settings only from their command
    line. The frequency stays, because the filters depend on it.
    """
    for _, record in records:
        if isinstance(record, Settings):
            frequency_hz = receiver.radio.center_frequency_hz
            receiver.radio = replace(record.radio, center_frequency_hz=frequency_hz)


def wait(
    frame: ProcessFrame, receiver: Receiver | Capture, delay_s: float, reason: str
) -> None:
    """Wait until the next attempt to open the radio; report meanwhile that it is missing."""
    end_s = monotonic_s() + delay_s
    frame.report("radio absent", ok=False, counters=receiver.counters, reason=reason)
    while frame.running and monotonic_s() < end_s:
        take_settings(frame.receive(timeout_s=0.2), receiver)
        frame.report("radio absent", ok=False, counters=receiver.counters, reason=reason)


if __name__ == "__main__":
    main()
