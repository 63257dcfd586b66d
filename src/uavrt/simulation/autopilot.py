"""Command line of the simulated autopilot, which ``uavrt demo`` runs as a child process."""

import argparse
import asyncio
import contextlib
import signal
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from uavrt.core.clock import Clock
from uavrt.core.errors import UavrtError
from uavrt.core.log import configure_logging, get_logger
from uavrt.simulation.scene.scenario_file import load_scenario
from uavrt.simulation.vehicle.fake_autopilot import AutopilotSettings, FakeAutopilot


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the simulated autopilot until SIGTERM or SIGINT."""
    options = _parser().parse_args(arguments)
    configure_logging("fake autopilot")
    clock = Clock.start() if options.clock_offset_ns is None else Clock(options.clock_offset_ns)
    try:
        scenario = load_scenario(options.scenario)
        if options.start_time_ns is not None:
            scenario = scenario.starting_at(options.start_time_ns)
        known = {one.name for one in fields(AutopilotSettings)}
        chosen = {name: value for name, value in vars(options).items() if name in known}
        settings = AutopilotSettings(**chosen | {"parameters": dict(options.parameters)})
        asyncio.run(_serve(FakeAutopilot(scenario.vehicle_pose, settings, clock)))
    except UavrtError as error:
        raise SystemExit(f"error: {error}") from error


async def _serve(autopilot: FakeAutopilot) -> None:
    task = asyncio.current_task()
    assert task is not None
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await autopilot.run()
    get_logger().info("stopped", **autopilot.counters())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m uavrt.simulation.autopilot", description="Simulated autopilot"
    )
    parser.add_argument("--scenario", required=True, help="scenario file; its flight is flown")
    parser.add_argument("--companion", required=True, type=_place, metavar="HOST:PORT")
    parser.add_argument("--ground", type=_place, metavar="HOST:PORT")
    parser.add_argument("--flavour", choices=("px4", "ardupilot"), default="px4")
    parser.add_argument("--system-id", type=int, default=1)
    parser.add_argument("--start-time-ns", type=int, help="start of the scenario [ns, UTC]")
    parser.add_argument("--clock-offset-ns", type=int, help="UTC minus CLOCK_MONOTONIC [ns]")
    parser.add_argument("--clock-skew-ppm", type=float, default=0.0)
    parser.add_argument("--companion-jitter-s", type=float, default=0.0)
    parser.add_argument("--ground-loss", type=float, default=0.0)
    each = {"type": _parameter, "action": "append", "default": [], "metavar": "NAME=VALUE"}
    parser.add_argument("--parameter", dest="parameters", **each)  # type: ignore[arg-type]
    parser.add_argument(
        "--flies",
        action="store_true",
        help="obey commands instead of flying the scenario's flight",
    )
    parser.add_argument(
        "--on-ground", action="store_true", help="with --flies: start disarmed on the ground"
    )
    parser.add_argument(
        "--path", type=Path, help="with --flies: file to which the flown path is written"
    )
    parser.add_argument(
        "--sticks", action="store_true", help="simulate a remote control that is switched on"
    )
    parser.add_argument("--seed", type=int, default=1)
    return parser


def _parameter(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    return name, float(value)


def _place(text: str) -> tuple[str, int]:
    host, separator, port = text.rpartition(":")
    if not separator or not host:
        raise argparse.ArgumentTypeError(f"{text!r} is not HOST:PORT")
    return host.strip("[]"), int(port)


if __name__ == "__main__":
    main()
