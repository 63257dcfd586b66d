"""``uavrt export``: a flight as files for other tools."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.analysis.bag import export_bag
from uavrt.errors import ConfigError


def export(
    flight: Path,
    *,
    mcap: bool = False,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Write a flight as files for other tools.

    Parameters
    ----------
    flight
        A flight directory.
    mcap
        As a ROS 2 recording for `ros2 bag play` and Foxglove: pulses, poses, commands and log
        with the messages of the live topics. Needs the extra uavrt[analysis].
    output
        Directory to make; by default "bag" in the flight directory.
    """
    if not mcap:
        raise ConfigError("no format is named", remedy="Add --mcap")
    bag = export_bag(flight, output if output is not None else flight / "bag")
    for topic, count in sorted(bag.messages.items()):
        print(f"{count:8d}  /{topic}")
    print(bag.file)
