"""Parameters that the operator has set, also in flight; they are kept over restarts.

A file stores each parameter with the value that the settings file had at that time. If the
settings file has changed since, its value applies and the stored one is dropped.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import msgspec

from uavrt.config.parameters import PARAMETERS, check_start, parameter_values, with_parameter
from uavrt.config.settings import Settings
from uavrt.core.errors import ConfigError, UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Command
from uavrt.flight.kept_file import KeptFile

log = get_logger()

PARAMETERS_NAME = "parameters.json"


class KeptValue(msgspec.Struct, frozen=True):
    """A parameter's value set by the operator, and the value in the settings file."""

    value: float
    instead_of: float
    """Value in the settings file when the operator set the parameter."""


class SettingsInForce:
    """Settings with the operator's parameters applied; `on_change` is called
    with changed ones.
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
                log.warning("invalid stored parameter ignored", reason=error.message)
        self._on_change = on_change
        self.now = self.in_flight = settings
        """Settings for the next flight (`now`), and for the present flight (`in_flight`)."""
        self.gain: int | None = None
        """Radio gain given with a start command; None: gain of the settings."""

    def resume(self, gain: int | None, waiting: Mapping[str, float]) -> None:
        """Restore a resumed flight's settings, which may differ from those for the next."""
        with suppress(UavrtError):
            self._use_gain(gain)
        self.in_flight = self.now
        for name, value in waiting.items():
            with suppress(UavrtError):
                self.in_flight = with_parameter(self.in_flight, name, value)

    @property
    def waiting(self) -> dict[str, float]:
        """Present values, by name, of the parameters that change at the next start."""
        now = parameter_values(self.now)
        in_flight = parameter_values(self.in_flight)
        return {name: one for name, one in in_flight.items() if one != now[name]}

    def begin_flight(self) -> None:
        """Use the latest settings for the flight that begins now."""
        self.in_flight = self.now

    def set(self, name: str | None, value: float | None, *, detecting: bool) -> str:
        """Set and store a parameter; return a text on when it applies, now or next start."""
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
        """Check a start command's frequency and gain, and apply the gain.

        Raises `ConfigError` if one is invalid.
        """
        check_start(self.now, command.center_frequency_hz, command.gain)
        self._use_gain(command.gain)

    def _use_gain(self, gain: int | None) -> None:
        if gain is not None:
            self._use(with_parameter(self.now, "RADIO_GAIN", gain))
            self.gain = gain

    def _use(self, settings: Settings) -> None:
        if settings != self.now:
            self.now = settings
            self._on_change(settings)
