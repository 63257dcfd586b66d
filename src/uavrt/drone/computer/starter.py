"""Desktop menu entry that starts the ground station (Desktop Entry Specification 1.0)."""

import os
from pathlib import Path

from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import NotFound, UsageError, os_errors_as

ENTRY = "applications/uavrt-ground.desktop"
ICON = "icons/hicolor/scalable/apps/uavrt-ground.svg"
ICON_TEXT = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32">\
<rect width="32" height="32" rx="7" fill="#0b5d75"/><circle cx="16" cy="20" r="3" fill="#fff"/>\
<path d="M9.5 15.5a9 9 0 0 1 13 0M6 11a14 14 0 0 1 20 0" fill="none" stroke="#fff" \
stroke-width="2.4" stroke-linecap="round"/></svg>
"""


def data_home() -> Path:
    """Directory of this user's desktop files (XDG Base Directory Specification)."""
    given = os.environ.get("XDG_DATA_HOME", "")
    # The specification ignores relative paths.
    return Path(given) if given.startswith("/") else Path.home() / ".local/share"


def install_starter(program: Path, place: Path) -> list[Path]:
    """Write the menu entry and its icon, replacing old ones; return the files written."""
    if not program.exists():
        raise NotFound(
            f"there is no {program}", remedy="Install uavrt, and call its own uavrt command"
        )
    files = {place / ENTRY: entry_text(program), place / ICON: ICON_TEXT}
    for path, text in files.items():
        with os_errors_as(UsageError, f"{path} cannot be written", "Give another --directory"):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, text)
    return list(files)


def remove_starter(place: Path) -> list[Path]:
    """Remove the files of `install_starter`; return those that existed."""
    removed = []
    for path in (place / ENTRY, place / ICON):
        try:
            path.unlink()
        except FileNotFoundError:
            continue
        removed.append(path)
    return removed


def entry_text(program: Path) -> str:
    """Text of the menu entry, which opens a terminal; closing the terminal ends the station."""
    return f"""\
[Desktop Entry]
Type=Application
Version=1.0
Name=uavrt
GenericName=Ground station
Comment=Find radio-tagged animals from a drone
Exec={_quoted(str(program))} ground
Icon=uavrt-ground
Terminal=true
Categories=Science;
Keywords=radio;telemetry;wildlife;drone;
"""


def _quoted(word: str) -> str:
    r"""Quote a word for ``Exec=``: escape reserved characters, then double ``\`` and ``%``."""
    if any(letter in word for letter in "\n\r\0"):
        raise UsageError(f"{word!r} has a line break", remedy="Give a path without one")
    escaped = "".join(f"\\{letter}" if letter in '"`$\\' else letter for letter in word)
    return '"' + escaped.replace("\\", "\\\\").replace("%", "%%") + '"'
