"""Parameters set by an operator: a file in the flights' folder that survives every restart.

Each is stored with the value of the settings file at the time. If that has changed since, the
settings file wins and the stored value is dropped.
"""

from pathlib import Path

import msgspec

from uavrt.config.parameters import parameter_values, with_parameter
from uavrt.config.settings import Settings
from uavrt.errors import ConfigError
from uavrt.log import get_logger
from uavrt.recording.kept_file import KeptFile

log = get_logger()

PARAMETERS_NAME = "parameters.json"


class KeptValue(msgspec.Struct, frozen=True):
    """One parameter."""

    value: float
    instead_of: float
    """Value in the settings file when this was set."""


class KeptParameters:
    """The file and its contents.

    `directory`: where flight directories are made. `settings`: of the settings file.
    """

    def __init__(self, directory: Path, settings: Settings) -> None:
        self._disk = KeptFile(directory / PARAMETERS_NAME, dict[str, KeptValue], "parameters")
        self._file = parameter_values(settings)
        self._kept = {
            name: kept
            for name, kept in (self._disk.read() or {}).items()
            if self._file.get(name) == kept.instead_of
        }

    def applied_to(self, settings: Settings) -> Settings:
        """Apply the kept values to settings; values that are no longer valid are left out."""
        for name, kept in self._kept.items():
            try:
                settings = with_parameter(settings, name, kept.value)
            except ConfigError as error:
                log.warning("kept parameter not used", reason=error.message)
        return settings

    def keep(self, name: str, value: float) -> None:
        """Store a value in force; a disk fault loses only that."""
        if self._file[name] == value:
            self._kept.pop(name, None)
        else:
            self._kept[name] = KeptValue(value, self._file[name])
        self._disk.keep(self._kept)
