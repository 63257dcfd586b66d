"""Change single settings in ``uavrt.toml`` without changing comments and other text."""

import copy
import json
import os
import stat
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uavrt.config.loader import default_settings_text, parse_settings
from uavrt.config.settings import Settings
from uavrt.config.text_files import decode_text
from uavrt.config.toml_lines import find_lines
from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import ConfigError, os_errors_as
from uavrt.core.foreign import SETTINGS, read_file

Value = str | int | float | bool | None
Changes = Mapping[tuple[str, str], Value]
"""New values of settings by table and key; None resets a setting to its default."""
_MOST_LINES = 200
"""Maximum number of lines in ``uavrt.toml`` that the value of one setting may take."""


def change_settings(path: str | os.PathLike[str], changes: Changes) -> Settings:
    """Write changes into ``uavrt.toml``; return all settings, or raise `ConfigError`."""
    target = Path(path)
    settings, text = changed_settings(target, changes)
    with os_errors_as(
        ConfigError,
        f"cannot write the settings {target}",
        "Check with uavrt doctor whether the card is full or read-only",
    ):
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o644
        write_atomically(target, text, mode=mode)
    return settings


def changed_settings(path: Path, changes: Changes) -> tuple[Settings, str]:
    """Apply changes to a settings file's text; return the settings and the new text without
    writing it. Raises `ConfigError`.
    """
    try:
        written = read_file(path, SETTINGS) if path.exists() else None
        before = default_settings_text() if written is None else decode_text(written)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigError(
            f"cannot read the settings {path}: {reason}", remedy="Make it readable UTF-8 text"
        ) from error
    parse_settings(before.encode(), name=path.name)
    text = before
    for (table, key), value in changes.items():
        text = _with_value(text, table, key, value)
    _require_only(before, text, changes, path)
    return parse_settings(text.encode(), name=path.name), text


def _with_value(text: str, table: str, key: str, value: Value) -> str:
    lines = text.split("\n")
    places = find_lines(text)
    # JSON writes these values as TOML does.
    shown = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    if value is None:
        shown = f"# {key} ="
    at = places.get((table, key))
    if at is not None:
        lines[at - 1 : _end_of_value(lines, at)] = [shown]
    elif value is None:
        return text
    elif (header := places.get((table,))) is not None:
        at = _left_out(lines, header, key)
        if at is None:
            lines.insert(header, shown)
        else:
            lines[at] = shown
    else:
        lines += [f"[{table}]", shown, ""]
    return "\n".join(lines)


def _end_of_value(lines: list[str], first: int) -> int:
    """Return the last line of a value that starts at line `first`; lines count from 1."""
    for last in range(first, min(len(lines), first + _MOST_LINES) + 1):
        try:
            tomllib.loads("\n".join(lines[first - 1 : last]))
        except tomllib.TOMLDecodeError:
            continue
        return last
    return first


def _left_out(lines: list[str], header: int, key: str) -> int | None:
    """Index of the commented-out line ``# key =`` of an unset setting in its table; None if
    there is no such line.
    """
    for number in range(header, len(lines)):
        if lines[number].startswith("["):
            return None
        if lines[number].rstrip() == f"# {key} =":
            return number
    return None


def _require_only(before: str, after: str, changes: Changes, path: Path) -> None:
    """Raise `ConfigError` unless exactly the requested values differ in the new text."""
    wanted: dict[str, Any] = copy.deepcopy(tomllib.loads(before))
    for (table, key), value in changes.items():
        inside = wanted.setdefault(table, {})
        if value is None:
            inside.pop(key, None)
        else:
            inside[key] = value
    try:
        found = tomllib.loads(after)
    except tomllib.TOMLDecodeError:
        found = {}
    if _without_empty(found) != _without_empty(wanted):
        names = ", ".join(f"[{table}] {key}" for table, key in changes)
        raise ConfigError(
            f"uavrt cannot change {names} in {path.name} because of the file's layout",
            remedy="Change the setting with an editor, or move the file away and start again",
        )


def _without_empty(document: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if value != {}}
