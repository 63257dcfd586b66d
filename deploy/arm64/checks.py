"""Compare the uavrt in an emulated root (enter.sh) with the one here: checks.py DIRECTORY.

The world (radio, autopilot) is simulated by this machine's own processor, as the air does not
run in an emulator; all of the drone side runs emulated, in real time where it can keep up. Each
check prints what it saw; the first that fails ends it with status 1.
"""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from uavrt.config.tags.tag_files import write_tags
from uavrt.core.clock import Clock
from uavrt.core.messages import SystemStatus
from uavrt.drone.status_reader import StatusReader
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario_file import write_scenario

HERE = Path(__file__).parent
PYTHON = "/opt/uavrt/venv/bin/python"
UAVRT = "/opt/uavrt/venv/bin/uavrt"
LOOKS = ["radio", "permissions", "autopilot", "clock", "disk", "card", "processor"]
LOOKS.append("temperature")
RATE_HZ = 250_000.0
SAMPLES_S = os.environ.get("SAMPLES_S", "40")
MOST_DB = 1e-3
FEED_S = 0.05
MESSAGES = 10
KILLED = ("connection", "detector-1", "recorder", "receiver")
SLOWEST_START_S = 180.0
RADIO = """\
#!/bin/sh
echo "$@" >/shared/tuned
exec cat /shared/samples
"""
NOTHING = "#!/bin/sh\n"
FLY = f"""\
#!/bin/sh
cd /shared
PATH=/shared:$PATH
{UAVRT} run --tags tags.toml &
while read -r order; do
    [ "$order" != end ] || {{ kill "$!"; wait "$!"; exit 0; }}
    kill -9 "$order"
done </shared/orders
"""


class Failed(Exception):
    """A check that does not hold."""


def require(good: bool, text: str) -> None:
    """Raise unless it holds."""
    if not good:
        raise Failed(text)


class Emulated:
    """Runs programs in the root.

    `work`: the directory that make-root.sh has made.
    """

    def __init__(self, work: Path) -> None:
        self._work = work
        self.root = work / "root"
        self.shared = work / "shared"
        shutil.rmtree(self.shared, ignore_errors=True)
        self.shared.mkdir()

    def command(self, *words: str) -> list[str]:
        """Get the words that run a program in the root."""
        return [str(HERE / "enter.sh"), str(self._work), *words]

    def start(self, *words: str, log: Path) -> "subprocess.Popen[bytes]":
        """Start one; `shared` is /shared there."""
        environment = os.environ | {"SHARE": f"{self.shared}:/shared"}
        with open(log, "wb") as file:
            return subprocess.Popen(
                self.command(*words), env=environment, stdout=file, stderr=file,
                stdin=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip

    def run(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """Run one to its end."""
        environment = os.environ | {"SHARE": f"{self.shared}:/shared"}
        return subprocess.run(
            self.command(*words), env=environment, capture_output=True, text=True, check=False
        )


@contextmanager
def ended(program: "subprocess.Popen[bytes]") -> Iterator["subprocess.Popen[bytes]"]:
    """End a program that was started, and all that it has started."""
    try:
        yield program
    finally:
        if program.poll() is None:
            os.killpg(program.pid, signal.SIGTERM)
            try:
                program.wait(20.0)
            except subprocess.TimeoutExpired:
                os.killpg(program.pid, signal.SIGKILL)
                program.wait()


def check_doctor(there: Emulated) -> str:
    """Does it look at everything?"""
    done = there.run(UAVRT, "doctor", "--config", "/var/lib/uavrt/uavrt.toml")
    lines = done.stdout.splitlines()
    require(
        [line[3:].split()[0] for line in lines if line] == LOOKS,
        f"doctor said {done.stdout}{done.stderr}",
    )
    processor = next(line for line in lines if "detection by" in line)
    return processor[3:].strip()


def check_kernels(there: Emulated) -> str:
    """Are the compiled kernels for this processor, and loaded?"""
    ask = "from uavrt.core.runtime import native; print(native.description())"
    done = there.run(PYTHON, "-c", ask)
    said = done.stdout.strip()
    require("compiled kernels for aarch64" in said, f"detection by {said}{done.stderr}")
    return said


def check_recording(there: Emulated) -> str:
    """Are the pulses those of this machine?"""
    world = there.shared / "world"
    ours = there.shared / "ours.jsonl"
    uavrt = [sys.executable, "-m", "uavrt.cli"]
    arguments = ["simulate", "demo", "--duration", SAMPLES_S, "--sample-rate", str(RATE_HZ)]
    subprocess.run([*uavrt, *arguments, "-o", str(world)], check=True, capture_output=True)
    recording = next(world.glob("*.sigmf-meta"))
    tags = world / "tags.toml"
    subprocess.run(
        [*uavrt, "detect", str(recording), "--tags", str(tags), "-o", str(ours)],
        check=True, capture_output=True,
    )  # fmt: skip
    begin_s = time.monotonic()
    done = there.run(
        UAVRT, "detect", f"/shared/world/{recording.name}", "--tags", "/shared/world/tags.toml",
        "-o", "/shared/theirs.jsonl",
    )  # fmt: skip
    took_s = time.monotonic() - begin_s
    require(done.returncode == 0, f"detect: {done.stderr}")
    a, b = (
        [json.loads(line) for line in path.read_text().splitlines()]
        for path in (ours, there.shared / "theirs.jsonl")
    )
    require(len(a) == len(b) and len(a) > 20, f"{len(a)} pulses here, {len(b)} there")
    pairs = list(zip(a, b, strict=True))
    apart_ns = max(abs(x["start_time_ns"] - y["start_time_ns"]) for x, y in pairs)
    apart_db = max(abs(x["snr_db"] - y["snr_db"]) for x, y in pairs)
    same = ("tag_id", "detection_status", "rate", "group_index")
    alike = all(x[name] == y[name] for x, y in pairs for name in same)
    require(alike, "tags, rates or confirmations differ")
    require(apart_ns < 1e9 / RATE_HZ, f"times are up to {apart_ns} ns apart")
    require(apart_db <= MOST_DB, f"SNRs are up to {apart_db:.2g} dB apart")
    return (
        f"{len(a)} pulses: times within {apart_ns} ns, SNR within {apart_db:.1g} dB "
        f"({SAMPLES_S} s of samples in {took_s:.0f} s, emulated)"
    )


class Watched:
    """A running drone side, seen through its status socket."""

    def __init__(self, path: Path) -> None:
        deadline_s = time.monotonic() + SLOWEST_START_S
        while True:
            try:
                self._reader = StatusReader(path, 1.0, lambda: None)
                return
            except Exception:
                if time.monotonic() > deadline_s:
                    raise
                time.sleep(0.5)

    def until(
        self, condition: Callable[[SystemStatus], bool], timeout_s: float
    ) -> SystemStatus:
        """Read until the status is as wanted."""
        last, deadline_s = None, time.monotonic() + timeout_s
        while time.monotonic() < deadline_s:
            for _, record in self._reader.read(0.2):
                if isinstance(record, SystemStatus):
                    last = record
                    if condition(record):
                        return record
        raise Failed(f"never came in {timeout_s:.0f} s; last: {last}")

    def close(self) -> None:
        """Leave it."""
        self._reader.close()


def process(status: SystemStatus, name: str) -> Any:
    """Get what is known of a process."""
    return next(p for p in status.processes if p.process == name)


def recorded(status: SystemStatus) -> float:
    """Pulses that the recorder has written since it started."""
    return float(process(status, "recorder").counters.get("pulses_recorded", 0.0))


class Feeder(threading.Thread):
    """The air: whenever the emulated radio program listens, the simulated one speaks to it.

    `shared`: where the programs meet: ``tuned`` (its arguments), ``samples`` (a pipe).
    """

    def __init__(self, shared: Path) -> None:
        super().__init__(daemon=True)
        self._shared = shared
        self.going = True

    def run(self) -> None:
        """Serve one radio program after the other."""
        while self.going:
            try:
                pipe = os.open(self._shared / "samples", os.O_WRONLY | os.O_NONBLOCK)
            except OSError:  # nobody listens
                time.sleep(FEED_S)
                continue
            os.set_blocking(pipe, True)
            words = (self._shared / "tuned").read_text().split()
            tuned = [words[words.index(option) + 1] for option in ("-f", "-s")]
            world = str(self._shared / "scenario.toml")
            command = [sys.executable, str(HERE / "air.py"), world, *tuned]
            radio = subprocess.Popen(command, stdout=pipe)
            os.close(pipe)
            while self.going and radio.poll() is None:
                time.sleep(FEED_S)
            radio.kill()
            radio.wait()


def check_flight(there: Emulated) -> str:
    """Does the drone side fly, with each of its processes killed once?"""
    shared = there.shared
    scenario = demo_scenario(900.0, 1).starting_at(Clock.start().now_ns() + 1_000_000_000)
    write_scenario(scenario, shared / "scenario.toml")
    write_tags(shared / "tags.toml", scenario.tags)
    companion = free_udp_port()
    os.mkfifo(shared / "samples")
    os.mkfifo(shared / "orders")
    (shared / "uavrt.toml").write_text(
        '[radio]\nkind = "rtlsdr"\nsample_rate_hz = 250000.0\n'
        'program = ["/shared/rtl_sdr"]\n'
        f'[mavlink]\naddress = "udpin://127.0.0.1:{companion}"\n'
        '[recording]\ndirectory = "/shared/flights"\nchannels = false\n',
        encoding="ascii",
    )
    for name, text in (("rtl_sdr", RADIO), ("rtl_biast", NOTHING), ("fly", FLY)):
        (shared / name).write_text(text)
        (shared / name).chmod(0o755)
    orders = os.open(shared / "orders", os.O_RDWR)
    autopilot = subprocess.Popen(
        [sys.executable, "-m", "uavrt.simulation.autopilot", "--scenario",
         str(shared / "scenario.toml"), "--companion", f"127.0.0.1:{companion}"],
        start_new_session=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    feeder = Feeder(shared)
    feeder.start()
    with ended(autopilot), ended(there.start("/shared/fly", log=shared / "run.log")) as drone:
        watched = Watched(shared / "flights/status.sock")
        status = watched.until(lambda s: recorded(s) >= 5, 240.0)
        took = []
        for name in KILLED:
            old, begin_s = process(status, name).pid, time.monotonic()
            os.write(orders, f"{old}\n".encode())
            status = watched.until(partial(is_back, name, old), 90.0)
            took.append(f"{name} {time.monotonic() - begin_s:.1f} s")
        begun = recorded(status)
        status = watched.until(lambda s: recorded(s) >= begun + 5, 120.0)
        load_s = sum(p.cpu_s for p in status.processes)
        watched.close()
        os.write(orders, b"end\n")
        drone.wait(60.0)
    feeder.going = False
    flight = shared / "flights" / Path(status.flight_directory or "").name
    read = read_flight(flight).pulse_poses
    posed = sum(item.pose is not None for item in read)
    require(posed > 10, f"only {posed} pulses with a pose in {flight}")
    return (
        f"{len(read)} pulses, {posed} with a pose; killed and back: {', '.join(took)}; "
        f"{load_s:.0f} s of CPU, emulated"
    )


def is_back(name: str, old: int, status: SystemStatus) -> bool:
    """Whether a killed process lives again and says that it is well."""
    now = process(status, name)
    return now.pid not in (None, old) and now.ok and now.status != "starting"


def check_page(there: Emulated) -> str:
    """Is the page served, with its script and its state?"""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    link = f"udpin://127.0.0.1:{free_udp_port()}"
    words = (UAVRT, "ground", "--page", "--port", str(port), "--no-browser")
    words += ("--mavlink", link, "--output", "/shared/ground")
    with ended(there.start(*words, log=there.shared / "ground.log")):
        address = f"http://127.0.0.1:{port}"
        page = fetched(address + "/", 120.0)
        scripts = re.findall(r'(?:src|href)="(/?assets/[^"]+)"', page)
        require(bool(scripts), f"no script in the page: {page[:300]}")
        sizes = [len(fetched(f"{address}/{name.lstrip('/')}", 20.0)) for name in scripts]
        state = json.loads(fetched(f"{address}/api/state", 20.0))
    return f"the page, {len(sizes)} files of {sum(sizes)} bytes, its state ({len(state)} parts)"


def check_ros2(there: Emulated) -> str:
    """Does the DDS binding that was built there reach this machine's?"""
    from heard import SPEAK, THERE, Heard  # the other checks need no DDS

    here, count, log = Heard(), 0, there.shared / "ros2.log"
    words = ("/usr/bin/env", f"CYCLONEDDS_URI={THERE}", PYTHON, "-c", SPEAK)
    begin_s = time.monotonic()
    with ended(there.start(*words, log=log)):
        while count < MESSAGES and time.monotonic() - begin_s < SLOWEST_START_S:
            time.sleep(0.2)
            count += here.count()
    said = log.read_text().strip()
    require(count >= MESSAGES, f"{count} messages came over ROS 2; there: {said}")
    return f"{count} messages by {said}"


def fetched(address: str, patience_s: float) -> str:
    """Get what a server says, as soon as it is there."""
    deadline_s = time.monotonic() + patience_s
    while True:
        try:
            with urllib.request.urlopen(address, timeout=20.0) as answer:
                return str(answer.read().decode())
        except OSError as error:
            if time.monotonic() > deadline_s:
                raise Failed(f"{address}: {error}") from error
            time.sleep(0.5)


def main() -> int:
    """Check all; 1 when one does not hold."""
    there = Emulated(Path(sys.argv[1]).resolve())
    wanted = sys.argv[2:]
    still = (check_doctor, check_kernels, check_recording, check_page, check_ros2)
    for check in (*still, check_flight):
        name = check.__name__.removeprefix("check_")
        if wanted and name not in wanted:
            continue
        begin_s = time.monotonic()
        try:
            text = check(there)
        except Failed as error:
            print(f"!! {name}: {error}", flush=True)
            return 1
        print(f"ok {name}: {text} [{time.monotonic() - begin_s:.0f} s]", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
