"""The whole chain in real time: simulated animals, real processes, a real ground program."""

import shutil
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import msgspec

from uavrt.clock import Clock
from uavrt.config import write_tags
from uavrt.demo import DemoPaths, Program, drone_settings, free_udp_port
from uavrt.errors import UavrtError
from uavrt.ground.store import PULSES_NAME
from uavrt.simulation import demo_scenario, write_scenario
from uavrt.units import ns_from_s
from uavrt_experiments.packets.matching import Match, match_logs

LEAD_S = 2.5
END_TIMEOUT_S = 40.0


def fly(
    duration_s: float,
    gap_s: float,
    *,
    loss: float = 0.0,
    seed: int = 1,
    flight_dir: Path,
    say: Callable[[str], None] = lambda line: None,
) -> Match:
    """Fly once and compare what the drone logged with what the ground received.

    Parameters
    ----------
    duration_s : float
        Length of the flight.
    gap_s : float
        Time between two tunnel messages, at least 0.012.
    loss : float
        Share of the frames that the radio link loses, each way.
    seed : int
        Of everything random.
    flight_dir : Path
        Where the flight's directory is made.
    say : callable
        Gets a line now and then.

    Raises
    ------
    UavrtError
        A program ended by itself.
    """
    with ExitStack() as stack:
        work = tempfile.mkdtemp(prefix="uavrt-packets-")
        stack.callback(shutil.rmtree, work, ignore_errors=True)
        paths = DemoPaths(directory=Path(work), flights=flight_dir.resolve())
        programs = _start(stack, paths, duration_s, gap_s, loss, seed)
        end_s = time.monotonic() + LEAD_S + duration_s
        while time.monotonic() < end_s:
            for program in programs:
                program.check()
            say(f"{gap_s * 1e3:.0f} ms, {end_s - time.monotonic():.0f} s to go")
            time.sleep(min(5.0, max(0.1, end_s - time.monotonic())))
        ground = programs[-1]
        ground.ask_to_stop()  # stops the detection and waits for the last pulses
        limit_s = time.monotonic() + END_TIMEOUT_S
        while not ground.ended and time.monotonic() < limit_s:
            time.sleep(0.1)
        for program in reversed(programs):
            program.stop()
        flights = sorted(paths.flights.glob("flight_log_*"), key=lambda p: p.stat().st_mtime)
        if not flights:
            raise UavrtError("no flight was started", remedy="Try again with a longer flight")
        return match_logs(flights[-1], paths.ground / PULSES_NAME)


def _start(
    stack: ExitStack,
    paths: DemoPaths,
    duration_s: float,
    gap_s: float,
    loss: float,
    seed: int,
) -> list[Program]:
    """Start autopilot, drone side and ground station."""
    companion_port, ground_port = free_udp_port(), free_udp_port()
    scenario = demo_scenario(duration_s + 60.0, seed)
    write_tags(paths.tags, scenario.tags)
    scenario = scenario.starting_at(Clock.start().now_ns() + ns_from_s(LEAD_S))
    write_scenario(scenario, paths.scenario)
    settings = drone_settings(scenario, paths, companion_port)
    settings = replace(settings, mavlink=replace(settings.mavlink, tunnel_gap_s=gap_s))
    autopilot = (
        "uavrt.simulation.autopilot",
        *("--scenario", str(paths.scenario)),
        *("--companion", f"127.0.0.1:{companion_port}"),
        *("--ground", f"127.0.0.1:{ground_port}"),
        *("--ground-loss", str(loss), "--seed", str(seed)),
    )
    ground = (
        "uavrt.cli",
        "ground",
        *("--mavlink", f"udpin://127.0.0.1:{ground_port}"),
        *("--tags", str(paths.tags), "--start", "--json", "-o", str(paths.ground)),
    )
    programs = []
    for name, arguments in (
        ("autopilot", autopilot),
        ("supervisor", ("uavrt.supervisor", msgspec.json.encode(settings).decode())),
        ("ground", ground),
    ):
        program = Program(name, arguments, paths.directory / f"{name}.log")
        stack.callback(program.stop)
        programs.append(program)
    return programs
