"""The option ``--dem`` of commands that take hills into account."""

from pathlib import Path
from typing import TYPE_CHECKING

from uavrt.core.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.localization.terrain.elevation import Elevation


def elevation_of(dem: Path | None, *, sea: bool = False) -> "Elevation | None":
    """Open elevation files; None if `dem` is not given.

    `sea`: treat ground without elevation data as water at height 0.
    """
    if dem is None and sea:
        raise ConfigError(
            "--sea has no effect without elevation files",
            remedy="Name elevation files with --dem, or leave --sea out",
        )
    if dem is None:
        return None
    from uavrt.localization.terrain.elevation_files import open_elevation

    return open_elevation(dem, sea=sea)
