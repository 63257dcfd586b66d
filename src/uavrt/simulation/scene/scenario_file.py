"""Read and write scenario files: TOML to `Scenario` and back."""

import json
import math
import tomllib
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from uavrt.config.tags.tag_files import faults_of_tags
from uavrt.core.clock import iso_utc, parse_iso_utc
from uavrt.core.errors import ConfigError, listed_faults
from uavrt.core.foreign import SETTINGS, check_toml, read_file, shortened
from uavrt.simulation.scene.scenario import Scenario


def load_scenario(path: str | Path) -> Scenario:
    """Read a scenario (docs/reference/scenario.md); raises `ConfigError` with all faults."""
    try:
        text = read_file(path, SETTINGS).decode()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not text in UTF-8"
        raise ConfigError(
            f"the scenario {path} cannot be read: {why}",
            remedy="Name an existing TOML file, or 'demo' for the built-in world",
        ) from error
    scenario = parse_scenario(text, source=str(path))
    dem = scenario.terrain.dem
    if dem is None:
        return scenario
    dem_path = str((Path(path).parent / dem).resolve())
    return replace(scenario, terrain=replace(scenario.terrain, dem=dem_path))


def parse_scenario(text: str, *, source: str = "scenario") -> Scenario:
    """Create a scenario from a file's text; raises `ConfigError` with all faults."""
    # Pydantic costs 0.1 s to import; those who build a Scenario in Python do without it.
    from pydantic import TypeAdapter, ValidationError

    try:
        check_toml(text, SETTINGS)
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ConfigError(
            f"{source} is not valid TOML: {error}",
            remedy="Correct the line, or start from a "
            "copy of the demo's scenario: uavrt simulate demo -o DIR",
        ) from error
    except ValueError as error:
        raise ConfigError(
            f"{source} cannot be read: {error}", remedy="Simplify or shorten the file"
        ) from error
    faults: list[str] = []
    _read_start_time(table, faults)
    try:
        scenario = TypeAdapter(Scenario).validate_python(table)
    except ValidationError as error:
        for fault in error.errors():
            place = _place(fault["loc"])
            faults.append(f"{place}: {fault['msg']} (given: {fault['input']!r:.60})")
    else:
        faults += scenario_faults(scenario)
    if faults:
        raise ConfigError(
            listed_faults(str(source), shortened(faults), len(faults)),
            remedy="Correct them; docs/reference/scenario.md lists every key",
        )
    return scenario


def _read_start_time(table: dict[str, Any], faults: list[str]) -> None:
    stamp = table.pop("start_time", None)
    if stamp is None:
        return
    if "start_time_ns" in table:
        faults.append("start_time: given twice, as start_time and as start_time_ns")
    try:
        table["start_time_ns"] = parse_iso_utc(str(stamp))
    except ValueError:
        faults.append(f"start_time: not an ISO 8601 time (given: {str(stamp)!r:.60})")


def _place(location: tuple[int | str, ...]) -> str:
    """Path of a value for error texts, such as ``tag[2].erp_dbm``; the numbers start at 1."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            text += f".{part}" if text else part
    return text or "file"


def scenario_faults(scenario: Scenario) -> list[str]:
    """Texts on values of a scenario that contradict each other; empty if there are none."""
    faults: list[str] = []
    seen: set[int] = set()
    for number, tag in enumerate(scenario.tag, start=1):
        place = f"tag[{number}]"
        if tag.tag_id in seen:
            faults.append(f"{place}.tag_id: {tag.tag_id} is used by an earlier tag")
        seen.add(tag.tag_id)
        width_s = max(tag.pulse_width_s, tag.true_pulse_width_s or 0.0)
        shortest_s = min(tag.pulse_intervals_s) + tag.interval_error_s - 2 * tag.jitter_s
        if shortest_s <= width_s:
            faults.append(
                f"{place}.pulse_intervals_s: with its error and jitter the interval can be "
                f"{shortest_s:g} s, not longer than the pulse of {width_s:g} s"
            )
        if tag.gaps_s and len(tag.pulse_intervals_s) > 1:
            faults.append(f"{place}.gaps_s: a coded tag has one interval, that of its bursts")
        if sum(tag.gaps_s) + width_s >= min(tag.pulse_intervals_s):
            faults.append(f"{place}.gaps_s: the burst is longer than its interval")
        if tag.gaps_s and min(tag.gaps_s) <= width_s:
            faults.append(f"{place}.gaps_s: a gap is not longer than the pulse")
        if tag.gaps_s and tag.listed:
            faults += [
                f"{place}: not valid in a tag file: {fault}"
                for fault in faults_of_tags([tag.tag])
            ]
        if list(tag.rate_switches_s) != sorted(set(tag.rate_switches_s)):
            faults.append(f"{place}.rate_switches_s: the times must increase")
        if tag.rate_switches_s and tag.rate_pattern:
            faults.append(f"{place}.rate_pattern: give a pattern or switch times, not both")
        if (tag.rate_switches_s or tag.rate_pattern) and len(tag.pulse_intervals_s) == 1:
            faults.append(f"{place}.pulse_intervals_s: two rates need two intervals")
    for number, interferer in enumerate(scenario.interferer, start=1):
        if interferer.kind == "carrier" and interferer.frequency_hz is None:
            faults.append(f"interferer[{number}].frequency_hz: a carrier needs a frequency")
    antenna = scenario.antenna
    if antenna.pattern == "table" and len(antenna.table_db) < 2:
        faults.append("antenna.table_db: the pattern 'table' needs at least 2 values")
    if antenna.pattern != "table" and antenna.table_db:
        faults.append(f"antenna.table_db: not used by the pattern {antenna.pattern!r}")
    return faults


def write_scenario(scenario: Scenario, path: str | Path) -> None:
    """Write a scenario file; `load_scenario` reads an equal scenario from it."""
    Path(path).write_text(scenario_toml(scenario), encoding="utf-8")


def scenario_toml(scenario: Scenario) -> str:
    """TOML text of a scenario, with every value that is not None."""
    readable = f"# starts {iso_utc(scenario.start_time_ns)}\n"
    return readable + "\n".join(_table_lines("", scenario)) + "\n"


def _table_lines(name: str, record: object) -> list[str]:
    plain: list[str] = []
    nested: list[str] = []
    assert is_dataclass(record)
    for item in fields(record):
        value = getattr(record, item.name)
        key = f"{name}.{item.name}" if name else item.name
        if value is None:
            continue
        if is_dataclass(value):
            nested += ["", f"[{key}]", *_table_lines(key, value)]
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            for entry in value:
                nested += ["", f"[[{key}]]", *_table_lines(key, entry)]
        else:
            plain.append(f"{item.name} = {_toml_value(value)}")
    return plain + nested


def _toml_value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml_value(entry) for entry in value) + "]"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, str):
        # A JSON string is a TOML basic string but for U+007F, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value)
