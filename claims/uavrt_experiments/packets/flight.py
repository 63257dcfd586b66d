"""The whole chain in real time: simulated animals, real processes, a real ground program."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from uavrt.config.tags.tag_files import write_tags
from uavrt.core.errors import UavrtError
from uavrt.ground.store.stored import PULSES_NAME
from uavrt.simulation.demo.demo_programs import DemoPaths
from uavrt.simulation.demo.rig import Rig, starting_in
from uavrt.simulation.scene.demo_world import demo_scenario
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
    """Fly once and compare the drone's log with the ground's.

    `duration_s`: length of the flight.
    `gap_s`: time between two tunnel messages, at least 0.012.
    `loss`: share of the frames that the radio link loses, each way.
    `seed`: of everything random.
    `flight_dir`: parent of the flight's directory.
    `say`: receives a line of progress now and then.
    Raises `UavrtError`: a program ended by itself.
    """
    with (
        TemporaryDirectory(prefix="uavrt-packets-", ignore_cleanup_errors=True) as name,
        Rig() as rig,
    ):
        work, flights = Path(name), flight_dir.resolve()
        paths = DemoPaths(directory=work, flights=flights)
        scenario = demo_scenario(duration_s + 60.0, seed)
        write_tags(paths.tags, scenario.tags)
        drone = rig.drone(
            starting_in(scenario, LEAD_S),
            paths,
            autopilot=("--ground-loss", str(loss), "--seed", str(seed)),
            settings=lambda made: replace(
                made, mavlink=replace(made.mavlink, tunnel_gap_s=gap_s)
            ),
        )
        ground = rig.ground(
            work,
            drone.ground_port,
            work / "ground",
            *("--tags", str(paths.tags), "--start", "--json"),
        )
        end_s = time.monotonic() + LEAD_S + duration_s
        while time.monotonic() < end_s:
            drone.check()
            ground.check()
            say(f"{gap_s * 1e3:.0f} ms, {end_s - time.monotonic():.0f} s to go")
            time.sleep(min(5.0, max(0.1, end_s - time.monotonic())))
        ground.terminate()  # stops the detection and waits for the last pulses
        limit_s = time.monotonic() + END_TIMEOUT_S
        while not ground.ended and time.monotonic() < limit_s:
            time.sleep(0.1)
        rig.close()
        flown = sorted(flights.glob("flight_log_*"), key=lambda p: p.stat().st_mtime)
        if not flown:
            raise UavrtError("no flight was started", remedy="Try again with a longer flight")
        return match_logs(flown[-1], work / "ground" / PULSES_NAME)
