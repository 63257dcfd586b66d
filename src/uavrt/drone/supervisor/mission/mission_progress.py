"""Report the progress of a flight's start and end as `Operation` records.

A start command is acknowledged before the radio delivers samples, so its success is reported
here.
"""

from collections.abc import Callable

from uavrt.core.clock import monotonic_s
from uavrt.core.commands import CommandName
from uavrt.core.messages import FlightInfo, Health, Operation

CAPTURED, NOT_CAPTURED = "captured", "not captured"
"""Status texts by which the receiver reports the end of a raw capture."""
NO_SAMPLES_LIMIT_S = 30.0
"""Time without samples, beyond its planned end, at which a raw capture fails [s]."""

NO_SAMPLES = "the radio delivers no samples. Check that it is plugged in"
FEW_SAMPLES = "the radio delivers too few samples. Check its cable, or set a lower sample rate"
SLOW_DISK = "the samples could not be written in time. Record to a faster disk, or record less"

_LONGEST_CAPTURE = 3.0
"""Longest extension of a raw capture whose samples arrive slowly, as a multiple of its
length."""


class FlightProgress:
    """Follows the start and end of a flight or capture; passes each step to `publish`."""

    def __init__(self, publish: Callable[[Operation], None]) -> None:
        self._publish = publish
        self._name: CommandName | None = None
        self._capture_s: float | None = None
        self._deadline_s = self._latest_s = float("inf")
        self._over = False
        self._fault = self._recorded = self._why = ""
        self._slow = NO_SAMPLES
        """Likely cause of a slow capture, used if the receiver reports no cause."""

    def started(self, flight: FlightInfo) -> None:
        """Begin tracking a new flight or capture."""
        self._capture_s, self._over = flight.capture_s, False
        self._fault = self._recorded = self._why = ""
        self._slow = NO_SAMPLES
        self._name = "start_detection" if flight.capture_s is None else "raw_capture"
        self._deadline_s = float("inf")
        if flight.capture_s is not None:
            self._deadline_s = monotonic_s() + flight.capture_s + NO_SAMPLES_LIMIT_S
            self._latest_s = self._deadline_s + _LONGEST_CAPTURE * flight.capture_s
        self._say("running", "waiting for samples")

    def heard(self, health: Health) -> None:
        """Evaluate a health report of the receiver; other processes are ignored."""
        if not health.process.startswith("receiver"):
            return
        if self._capture_s is not None and health.ok:
            self._recorded = health.reason or self._recorded
        if self._over:
            return
        if self._capture_s is not None:
            self._why = health.reason
            if health.status.startswith("receiving"):  # slowly, but to its end
                later_s = max(self._deadline_s, monotonic_s() + NO_SAMPLES_LIMIT_S)
                self._deadline_s = min(later_s, self._latest_s)
                dropped = health.counters.get("recording_samples_dropped")
                self._slow = SLOW_DISK if dropped else FEW_SAMPLES
        if self._name == "start_detection" and health.status == "receiving":
            self._say("complete", "samples flow")
            self._name = None
        elif self._name == "raw_capture" and health.status in (CAPTURED, NOT_CAPTURED):
            self._over = True
            self._fault = "" if health.status == CAPTURED else "the samples were not recorded"

    def capture_over(self) -> bool:
        """True if a capture has recorded all its samples, or has failed."""
        if self._capture_s is None:
            return False
        if monotonic_s() > self._deadline_s and not self._over:
            self._over, self._fault = True, self._why or self._slow
        return self._over

    def stopping(self) -> None:
        """Report that the flight is ending, on a command."""
        if self._capture_s is None:
            self._name = "stop_detection"
            self._say("running", "waiting for the last pulses")

    def ended(self, directory: str) -> str:
        """Report that the flight is closed; return the text for the operator."""
        captured = self._capture_s is not None
        failed = captured and bool(self._fault) and not self._recorded
        if failed:
            text = f"Raw capture failed: {self._fault}"
        elif captured:
            text = f"Raw capture: {self._recorded or directory}"
            text += f": {self._fault}" if self._fault else ""
        else:
            text = "Detection stopped"
        self._say("failed" if failed else "complete", text)
        self._name = self._capture_s = None
        self._deadline_s = float("inf")
        return text

    def _say(self, state: str, message: str) -> None:
        if self._name is not None:
            self._publish(Operation(name=self._name, state=state, message=message))  # type: ignore[arg-type]
