"""Write a scenario as files: SigMF recording, telemetry, true pulses and tag lists."""

import csv
import hashlib
import json
import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import uavrt
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.clock import iso_utc
from uavrt.core.errors import ConfigError, RecordingError, os_errors_as
from uavrt.core.messages import Pose
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.scene.world import TruePulse
from uavrt.simulation.synthesis import CHUNK_SAMPLES, IQSynthesizer, SampleFormat, encode

_SIGMF_TYPES: dict[SampleFormat, str] = {"cf32": "cf32_le", "cs16": "ci16_le"}
_SAMPLE_BYTES: dict[SampleFormat, int] = {"cf32": 8, "cs16": 4}
_TELEMETRY_RATE_HZ = 50
SWITCH_KEY = "uavrt:antenna_switch"
"""Key of the antenna switch in the global metadata of a SigMF file
(docs/reference/scenario.md)."""
TELEMETRY_COLUMNS = (
    *("time_ns", "latitude_deg", "longitude_deg", "altitude_amsl_m", "altitude_relative_m"),
    *("qw", "qx", "qy", "qz"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRecording:
    """Paths of the files that were written for one simulated recording."""

    data: Path
    metadata: Path
    telemetry: Path
    truth: Path
    tag_info: Path
    tags: Path
    scenario: Path
    samples: int
    pulses: int
    outside: tuple[int, ...]
    """Ids of the tags with frequencies outside the recorded band."""
    cut: tuple[int, ...]
    """Ids of coded and two-interval tags, which TagInfo.txt cannot fully describe."""


def simulate_to_directory(
    scenario: Scenario,
    directory: str | Path,
    *,
    duration_s: float | None = None,
    sample_format: SampleFormat = "cf32",
    sample_rate_hz: float | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> SimulatedRecording:
    """Record a scenario from its start; `directory` is created or must be empty.

    `on_progress` is called with the number of samples written and their total.
    """
    duration_s = scenario.duration_s if duration_s is None else duration_s
    scenario = replace(scenario, duration_s=duration_s)
    rate_hz = scenario.radio.sample_rate_hz if sample_rate_hz is None else sample_rate_hz
    if not (0.0 < duration_s < math.inf and 0.0 < rate_hz < math.inf):
        raise ConfigError(
            f"cannot record {duration_s:g} s at {rate_hz:g} samples a second",
            remedy="Give --duration and --sample-rate as positive numbers: 60 and 3e6",
        )
    synthesizer = IQSynthesizer(scenario, sample_rate_hz=rate_hz)
    total = round(duration_s * rate_hz)
    base = Path(directory)
    with os_errors_as(
        RecordingError,
        f"the simulation cannot be written to {base}",
        "Choose a writable directory with enough space",
    ):
        _prepare(base, total * _SAMPLE_BYTES[sample_format])
        return _record(synthesizer, base, total, sample_format, on_progress)


def _prepare(base: Path, size_bytes: int) -> None:
    if base.exists() and any(base.iterdir()):
        raise RecordingError(
            f"{base} is not empty", remedy="Name a new directory; nothing is overwritten"
        )
    above = next(place for place in (base, *base.absolute().parents) if place.exists())
    free = shutil.disk_usage(above).free
    if free < size_bytes:
        raise RecordingError(
            f"the recording needs {size_bytes / 1e6:.0f} MB, but {base} has only "
            f"{free / 1e6:.0f} MB free",
            remedy="Record less, at a lower rate, or as cs16",
        )
    base.mkdir(parents=True, exist_ok=True)


def _record(
    synthesizer: IQSynthesizer,
    base: Path,
    total: int,
    sample_format: SampleFormat,
    on_progress: Callable[[int, int], None] | None,
) -> SimulatedRecording:
    scenario = synthesizer.scenario
    end_ns = synthesizer.time_ns_at(total)
    pulses = synthesizer.world.truth(scenario.start_time_ns, end_ns)
    result = SimulatedRecording(
        data=base / "simulation.sigmf-data",
        metadata=base / "simulation.sigmf-meta",
        telemetry=base / "telemetry.csv",
        truth=base / "truth.csv",
        tag_info=base / "TagInfo.txt",
        tags=base / "tags.toml",
        scenario=base / "scenario.toml",
        samples=total,
        pulses=len(pulses),
        cut=tuple(
            tag.tag_id for tag in scenario.tags if tag.coded or len(tag.pulse_intervals_s) > 1
        ),
        outside=tuple(
            tag.tag_id for tag in scenario.tags if not synthesizer.in_band(tag.frequency_hz)
        ),
    )
    # The small files first: if the disk fills up, they describe the samples there.
    write_scenario(scenario, result.scenario)
    if scenario.tags:
        # TagInfo.txt has no column for a second interval: there a tag has its first one only.
        # Coded tags have no place in it at all.
        beeping = [
            replace(tag, pulse_intervals_s=tag.pulse_intervals_s[:1])
            for tag in scenario.tags
            if not tag.coded
        ]
        if beeping:
            write_tags(result.tag_info, beeping)
        write_tags(result.tags, scenario.tags)
    write_truth(result.truth, pulses)
    _write_telemetry(result.telemetry, scenario, end_ns)
    checksum = _write_samples(synthesizer, result.data, total, sample_format, on_progress)
    metadata = _sigmf_metadata(synthesizer, sample_format, pulses, checksum)
    result.metadata.write_text(json.dumps(metadata, indent=2) + "\n", encoding="utf-8")
    return result


def _write_samples(
    synthesizer: IQSynthesizer,
    path: Path,
    total: int,
    sample_format: SampleFormat,
    on_progress: Callable[[int, int], None] | None,
) -> str:
    checksum = hashlib.sha512()
    done = 0
    with path.open("wb") as file:
        while done < total:
            count = min(CHUNK_SAMPLES, total - done)
            content = encode(synthesizer.block(done, count), sample_format)
            file.write(content)
            checksum.update(content)
            done += count
            if on_progress is not None:
                on_progress(done, total)
    return checksum.hexdigest()


def write_truth(path: Path, pulses: Sequence[TruePulse]) -> None:
    """Write the true pulses as CSV, with a column for each field of `TruePulse`."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [item.name for item in fields(TruePulse)])
        writer.writeheader()
        writer.writerows(asdict(pulse) for pulse in pulses)


def telemetry(scenario: Scenario, end_time_ns: int) -> Iterator[Pose]:
    """Poses of the vehicle, 50 a second, from the start until just after the end."""
    step_ns = 1_000_000_000 // _TELEMETRY_RATE_HZ
    steps = -(-(end_time_ns - scenario.start_time_ns) // step_ns)
    for step in range(steps + 1):
        yield scenario.vehicle_pose(scenario.start_time_ns + step * step_ns)


def _write_telemetry(path: Path, scenario: Scenario, end_time_ns: int) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(TELEMETRY_COLUMNS)
        for pose in telemetry(scenario, end_time_ns):
            writer.writerow(
                (
                    pose.time_ns,
                    f"{pose.latitude_deg:.9f}",
                    f"{pose.longitude_deg:.9f}",
                    f"{pose.altitude_amsl_m:.3f}",
                    f"{pose.altitude_relative_m:.3f}",
                    *(f"{part:.7f}" for part in pose.quaternion_wxyz),
                )
            )


def _sigmf_metadata(
    synthesizer: IQSynthesizer,
    sample_format: SampleFormat,
    pulses: Sequence[TruePulse],
    checksum: str,
) -> dict[str, Any]:
    scenario = synthesizer.scenario
    annotations = []
    for pulse in pulses:
        first = synthesizer.index_at(pulse.start_time_ns)
        annotations.append(
            {
                "core:sample_start": first,
                "core:sample_count": synthesizer.index_at(pulse.end_time_ns) - first,
                "core:freq_lower_edge": pulse.frequency_hz - 100.0,
                "core:freq_upper_edge": pulse.frequency_hz + 100.0,
                "core:label": f"tag {pulse.tag_id}",
                "core:comment": f"ENR {pulse.enr_db:.1f} dB",
            }
        )
    switch = scenario.antenna.switch
    marked = {} if switch is None else {SWITCH_KEY: switch.metadata(synthesizer.sample_rate_hz)}
    return {
        "global": {
            **marked,
            "core:datatype": _SIGMF_TYPES[sample_format],
            "core:sample_rate": synthesizer.sample_rate_hz,
            "core:version": "1.2.0",
            "core:sha512": checksum,
            "core:description": f"simulated scenario '{scenario.name}', seed {scenario.seed}",
            "core:recorder": f"uavrt {uavrt.__version__}",
        },
        "captures": [
            {
                "core:sample_start": 0,
                "core:frequency": synthesizer.center_frequency_hz,
                "core:datetime": iso_utc(scenario.start_time_ns),
            }
        ],
        "annotations": sorted(annotations, key=lambda entry: entry["core:sample_start"]),
    }
