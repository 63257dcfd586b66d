"""``uavrt simulate``: record a scenario, with its true pulses."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from uavrt.cli.options.kinds import Hertz, Seconds, Seed
from uavrt.cli.shown.progress_bars import progress_bar
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import load_scenario
from uavrt.simulation.simulated_recording import simulate_to_directory
from uavrt.simulation.synthesis import SampleFormat


def simulate(
    scenario: str,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    duration: Seconds | None = None,
    seed: Seed | None = None,
    format: Annotated[SampleFormat, Parameter(name="--format")] = "cf32",
    sample_rate: Hertz | None = None,
) -> None:
    """Record a simulated world: SigMF samples, telemetry, true pulses and tag lists.

    Parameters
    ----------
    scenario
        A scenario file (TOML), or 'demo' for the built-in world.
    output
        Directory to write to; created if needed, must be empty.
    duration
        Length in seconds; by default the scenario's.
    seed
        Seed of everything random; by default the scenario's.
    format
        cf32: pairs of float32 as airspy_rx -t 0 writes them; cs16: pairs of int16.
    sample_rate
        Samples per second; by default the scenario's (3 000 000).
    """
    console = Console(stderr=True)
    with progress_bar("simulating") as on_progress:
        recording = simulate_to_directory(
            _scenario(scenario, duration, seed),
            output,
            duration_s=duration,
            sample_format=format,
            sample_rate_hz=sample_rate,
            on_progress=on_progress,
        )
    if recording.outside:
        ids = ", ".join(map(str, recording.outside))
        console.print(
            f"These tags are outside the recorded band and not in the recording: {ids}. "
            "Record at a higher --sample-rate, or set radio.center_frequency_hz"
        )
    if recording.cut:
        ids = ", ".join(map(str, recording.cut))
        console.print(
            f"{recording.tag_info.name} cannot hold a second interval or a code: of tag {ids} "
            f"it has less. Detect with {recording.tags.name}"
        )
    print(
        f"{recording.data}: {recording.samples} samples, {recording.pulses} pulses "
        f"(true ones in {recording.truth.name}, tags in {recording.tags.name})"
    )


def _scenario(name: str, duration_s: float | None, seed: int | None) -> Scenario:
    if name == "demo" and not Path(name).exists():
        # A shorter recording is the beginning of the shortest demo.
        return demo_scenario(max(40.0, duration_s or 60.0), seed=1 if seed is None else seed)
    scenario = load_scenario(name)
    return scenario if seed is None else replace(scenario, seed=seed)
