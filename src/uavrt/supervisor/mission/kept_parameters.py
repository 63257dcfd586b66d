"""Settings that an operator can change, also in flight; they survive every restart.

A file in the flights' folder has each parameter with the value of the settings file at the
time. If that has changed since, the settings file wins and the stored value is dropped.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import msgspec

from uavrt.config.parameters import PARAMETERS, check_start, parameter_values, with_parameter
from uavrt.config.settings import Settings
from uavrt.errors import ConfigError, UavrtError
from uavrt.log import get_logger
from uavrt.messages import Command
from uavrt.recording.kept_file import KeptFile

log = get_logger()

PARAMETERS_NAME = "parameters.json"


class KeptValue(msgspec.Struct, frozen=True):
    """One parameter."""

    value: float
    instead_of: float
    """Value in the settings file when this was set."""


class SettingsInForce:
    """The settings with the operator's parameters.

    `settings`: of the settings file. `on_change`: called when those for the next start have
    changed.
    """

    def __init__(self, settings: Settings, on_change: Callable[[Settings], None]) -> None:
        path = Path(settings.recording.directory) / PARAMETERS_NAME
        self._disk = KeptFile(path, dict[str, KeptValue], "parameters")
        self._file = parameter_values(settings)
        self._kept = {
            name: kept
            for name, kept in (self._disk.read() or {}).items()
            if self._file.get(name) == kept.instead_of
        }
        for name, kept in self._kept.items():
            try:
                settings = with_parameter(settings, name, kept.value)
            except ConfigError as error:
                log.warning("kept parameter not used", reason=error.message)
        self._on_change = on_change
        self.now = self.in_flight = settings
        """Settings for the next start, and those in force in the present flight."""
        self.gain: int | None = None
        """Gain of the last start, in place of the settings' one."""

    def resume(self, gain: int | None, waiting: Mapping[str, float]) -> None:
        """Use a start's gain again, and in the flight the values before its last changes."""
        with suppress(UavrtError):
            self._use_gain(gain)
        self.in_flight = self.now
        for name, value in waiting.items():
            with suppress(UavrtError):
                self.in_flight = with_parameter(self.in_flight, name, value)

    @property
    def waiting(self) -> dict[str, float]:
        """Present values of parameters that change at the next start."""
        now = parameter_values(self.now)
        in_flight = parameter_values(self.in_flight)
        return {name: one for name, one in in_flight.items() if one != now[name]}

    def begin_flight(self) -> None:
        """Put the settings for the next start in force."""
        self.in_flight = self.now

    def set(self, name: str | None, value: float | None, *, detecting: bool) -> str:
        """Change a setting, now and for later starts; answer when it comes into force."""
        if name is None or value is None:
            raise UavrtError("the parameter or its value is missing")
        waits = detecting and not PARAMETERS[name].live
        if not waits:
            self.in_flight = with_parameter(self.in_flight, name, value)
        self._use(with_parameter(self.now, name, value))
        if self._file[name] == value:
            self._kept.pop(name, None)
        else:
            self._kept[name] = KeptValue(value, self._file[name])
        self._disk.keep(self._kept)
        if name == "RADIO_GAIN":
            self.gain = None
        return f"{name} = {value:.7g}{', from the next start' if waits else ''}"

    def use_start(self, command: Command) -> None:
        """Use the values of a start or a capture, if the radio supports them."""
        check_start(self.now, command.center_frequency_hz, command.gain)
        self._use_gain(command.gain)

    def _use_gain(self, gain: int | None) -> None:
        """Use a start's gain, until another is set or uavrt is stopped."""
        if gain is not None:
            self._use(with_parameter(self.now, "RADIO_GAIN", gain))
            self.gain = gain

    def _use(self, settings: Settings) -> None:
        if settings != self.now:
            self.now = settings
            self._on_change(settings)
