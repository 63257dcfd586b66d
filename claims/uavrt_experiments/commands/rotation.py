"""The command ``uavrt experiment rotation``."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavrt.cli.options.kinds import Count, Degrees, Hertz, Seed
from uavrt.cli.shown.outputs import check_place
from uavrt.core.errors import UsageError


def rotation(
    *,
    flight: Path | None = None,
    bearing: Degrees | None = None,
    start_heading: Degrees | None = None,
    antenna: str = "RA-23K",
    walls: Count = 200,
    sample_rate: Hertz = 15_000.0,
    seed: Seed = 1,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> None:
    """Repeat the thesis's rotation test and show the cause of its error of 50 degrees.

    Parameters
    ----------
    flight
        Read a real rotation instead of the simulated one: a flight directory or an old log.
    bearing
        The tag's true bearing in that flight, degrees clockwise from true north.
    start_heading
        Heading at its first pulse; corrects the half-way headings of the original's logs.
    antenna
        Name of the antenna's pattern, for --flight.
    walls
        Number of random walls, to find how often reflections shift a bearing.
    sample_rate
        Samples per second of the simulated radio; 375000, as in the thesis after its first
        decimation, takes a minute for each turn.
    seed
        Seed of everything random.
    output
        Also write figures and text as one HTML file.
    """
    if not 3000.0 <= sample_rate <= 24e6:
        raise UsageError(
            f"a sample rate of {sample_rate:g} is not possible",
            remedy="Give --sample-rate between 3000 and 24e6",
        )
    if output is not None:
        check_place(output, overwrite=True)
    if flight is not None:
        _real(flight, bearing, start_heading, antenna, output)
        return
    from uavrt_experiments.rotation.cart import BEARING_DEG
    from uavrt_experiments.rotation.run import (
        cases,
        polarization_table,
        start_sweep,
        wall_survey,
    )
    from uavrt_experiments.rotation.words import (
        case_lines,
        legend_lines,
        polarization_lines,
        sweep_lines,
        verdict_lines,
        wall_lines,
    )

    print("turns from samples, with and without a wall …", file=sys.stderr)
    found = cases(sample_rate, seed)
    print(f"{walls} random walls …", file=sys.stderr)
    survey = wall_survey(walls, seed)
    print("polarization …", file=sys.stderr)
    mismatch = polarization_table([0, 15, 30, 45, 60, 75, 90], sample_rate, seed)
    parts = [
        [*case_lines(found), *legend_lines()],
        sweep_lines(start_sweep(range(0, 180, 20), seed)),
        wall_lines(survey),
        polarization_lines(mismatch),
        verdict_lines(found, survey),
    ]
    print("\n\n".join("\n".join(lines) for lines in parts))
    if output is not None:
        from uavrt_experiments.rotation.figures import rotation_page

        rows = [(case.name, case.reading, BEARING_DEG) for case in found]
        output.write_text(rotation_page("Rotation test", rows, parts), encoding="utf-8")


def _real(
    flight: Path,
    bearing: float | None,
    start_heading: float | None,
    antenna: str,
    output: Path | None,
) -> None:
    from uavrt.analysis.measure.antenna_files import antenna_named
    from uavrt_experiments.rotation.real import real_rotations

    found = real_rotations(
        flight,
        bearing_deg=bearing,
        start_heading_deg=start_heading,
        antenna=antenna_named(antenna),
    )
    parts = [one.lines() for one in found]
    print("\n".join("\n".join(lines) for lines in parts))
    if output is not None:
        from uavrt_experiments.rotation.figures import rotation_page

        rows = [(f"tag {one.tag_id}", one.reading, bearing) for one in found]
        output.write_text(rotation_page(flight.name, rows, parts), encoding="utf-8")
