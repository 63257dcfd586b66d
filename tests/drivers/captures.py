"""Raw captures that are killed or whose disk fills up, with a stand-in radio."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from radio_world import SERIALS, TAG_HZ, RadioWorld

from uavrt.config.loader import load_settings
from uavrt.core.clock import monotonic_s
from uavrt.core.messages import Command, CommandReply, ProcessStatus, StatusText, SystemStatus
from uavrt.drone.status_reader import StatusReader, status_socket_path
from uavrt.radio.opening import open_recording

RATE_HZ = 250e3
BYTES_A_SECOND = 4 * RATE_HZ


class CapturingDrone:
    """`uavrt run` with an RTL-SDR; everything it started ends with `close`."""

    def __init__(self, directory: Path, capture_s: float) -> None:
        self.world = RadioWorld(directory / "world", "rtlsdr")
        self.flights = directory / "flights"
        self._directory, self._stack = directory, ExitStack()
        self._number = self._log_bytes = 0
        self._texts: list[str] = []
        self._processes: tuple[ProcessStatus, ...] = ()
        (directory / "uavrt.toml").write_text(
            f'status_socket = "{directory}/s"\n[radio]\nkind = "rtlsdr"\nretry_s = 0.2\n'
            f'sample_rate_hz = {RATE_HZ}\nserial = "{SERIALS["rtlsdr"]}"\n'
            f'[mavlink]\naddress = ""\n[recording]\ndirectory = "{self.flights}"\n'
            f"minimum_free_mb = 1.0\ncapture_s = {capture_s}\n"
        )
        self.start()

    def start(self) -> None:
        """Start the drone side, also again after it was killed."""
        config = self._directory / "uavrt.toml"
        log = self._stack.enter_context((self._directory / "log").open("a"))
        self.supervisor = self._stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", "uavrt.cli", "run", "-c", str(config)],
                env=self.world.environment,
                stdout=log,
                stderr=log,
            )
        )
        self._stack.callback(self.supervisor.terminate)
        path = status_socket_path(load_settings(config))
        self._reader = StatusReader(path, 40.0, lambda: None)
        self._stack.callback(self._reader.close)

    def capture(self, disturb: Callable[["CapturingDrone"], object]) -> list[str]:
        """Capture once with a disturbance; get the texts to the operator."""
        self._number += 1
        command = Command(
            name="raw_capture",
            request_id=self._number,
            center_frequency_hz=TAG_HZ,
            source=f"test {os.getpid()}",
        )
        self._reader.send("command", command)
        self._texts.clear()
        self._log_bytes = (self._directory / "log").stat().st_size
        self._until(lambda one: isinstance(one, CommandReply) and one.accepted)
        disturb(self)
        self._until(lambda _: self._is_over())
        return [*self._texts]

    def _is_over(self) -> bool:
        return any(one.startswith("Raw capture") for one in self._texts)

    def kill_process(self, name: str) -> None:
        """Kill a process; the receiver once samples came, nothing once the capture is over."""
        found = [one for one in self._processes if one.process == name and one.pid]
        if found and not self._is_over():
            with suppress(ProcessLookupError):
                os.kill(int(found[0].pid or 0), signal.SIGKILL)

    def kill_supervisor(self) -> None:
        """Kill the supervisor, and start the drone side again."""
        self.supervisor.kill()
        self.supervisor.wait()
        while self._reader.is_open:
            self._read()
        self.start()
        # What it said in its last and first moments nobody could read: the log has it.
        lines = (self._directory / "log").read_bytes()[self._log_bytes :].decode().splitlines()
        self._texts += [json.loads(one)["event"] for one in lines if '"Raw capture' in one]
        self._processes = ()

    def wait_for_samples(self) -> None:
        """Wait until the receiver receives."""
        self._until(
            lambda _: (
                any(one.status == "receiving" for one in self._processes) or self._is_over()
            )
        )

    def recorded_s(self) -> float:
        """Seconds in the files of the newest capture, each read to its end."""
        flight = max(self.flights.glob("flight_log_*"), key=lambda one: one.stat().st_mtime_ns)
        samples = 0
        for data in flight.glob("iq/capture_*.sigmf-data"):
            if not data.stat().st_size:
                continue
            source = open_recording(data)
            assert data.stat().st_size // 4 == source.total_samples
            with_data = 0
            while with_data < (source.total_samples or 0):
                block = source.read()
                assert block is not None
                with_data += len(block.samples)
            source.close()
            assert "Raw capture" in data.with_suffix(".sigmf-meta").read_text()
            samples += with_data
        return samples / RATE_HZ

    def close(self) -> None:
        """End everything."""
        self._stack.close()

    def _until(self, wanted: Callable[[Any], bool]) -> None:
        deadline_s = monotonic_s() + 60.0
        while monotonic_s() < deadline_s:
            if any(map(wanted, self._read())):
                return
        raise AssertionError(f"never came; texts: {self._texts}")

    def _read(self) -> list[object]:
        records = [record for _, record in self._reader.read(0.1)]
        for record in records:
            if isinstance(record, StatusText):
                self._texts.append(record.text)
            elif isinstance(record, SystemStatus):
                self._processes = record.processes
        return records
