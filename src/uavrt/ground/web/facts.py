"""Who flew what, as the page shows and changes it: the report.toml of the flights' folder."""

from dataclasses import asdict
from pathlib import Path

from uavrt.analysis.facts import NAME, Facts, read_facts, write_facts
from uavrt.errors import ConfigError, UsageError


def told_facts(folder: Path) -> dict[str, str]:
    """Each field with its text; empty where nothing was told.

    Raises `ConfigError`: a file written by hand cannot be read.
    """
    path = folder / NAME
    found = read_facts(path) if path.is_file() else Facts()
    return {name: text or "" for name, text in asdict(found).items()}


def tell_facts(folder: Path, told: object) -> dict[str, str]:
    """Change some fields; gives all of them.

    Raises `UsageError`: a field is wrong; the text says which.
    Raises `ConfigError`: the file that is there cannot be read.
    """
    now = told_facts(folder)
    if not isinstance(told, dict):
        raise UsageError("facts must be an object")
    for name, text in told.items():
        if name not in now:
            raise UsageError(f"reports have no field {str(name)[:40]!r}")
        if not isinstance(text, str):
            raise UsageError(f"{name} is not text")
        now[name] = text.strip()
    try:
        write_facts(folder, Facts(**{name: text or None for name, text in now.items()}))
    except ConfigError as error:
        raise UsageError(error.message, remedy=error.remedy) from error
    return now
