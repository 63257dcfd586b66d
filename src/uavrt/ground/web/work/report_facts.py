"""Read and change the texts for reports, stored in report.toml in the folder of flights."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from uavrt.analysis.inputs.flight_facts import NAME, ReportFacts, read_facts, write_facts
from uavrt.core.errors import ConfigError, UsageError


def facts_in(folder: Path) -> dict[str, str]:
    """Return the text of each field, empty if it is not set; raises `ConfigError`."""
    path = folder / NAME
    found = read_facts(path) if path.is_file() else ReportFacts()
    return {name: text or "" for name, text in asdict(found).items()}


def change_facts(folder: Path, values: dict[str, Any]) -> dict[str, str]:
    """Change the given fields and return all fields; raises `UsageError` or `ConfigError`."""
    now = facts_in(folder)
    for name, text in values.items():
        if name not in now:
            raise UsageError(f"reports have no field {str(name)[:40]!r}")
        if not isinstance(text, str):
            raise UsageError(f"{name} is not text")
        now[name] = text.strip()
    try:
        write_facts(folder, ReportFacts(**{name: text or None for name, text in now.items()}))
    except ConfigError as error:
        raise UsageError(error.message, remedy=error.remedy) from error
    return now
