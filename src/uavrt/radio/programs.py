"""The radios' own programs and their arguments.

The table is `uavrt.config.radios`; what each program's arguments are stands in its module. The
programs are run as they are; nothing of them is linked.
"""

from importlib import import_module

from uavrt.config import RADIOS, RadioRow, RadioSettings, tuned_frequency
from uavrt.errors import ConfigError

PROGRAMS: dict[str, RadioRow] = {kind: row for kind, row in RADIOS.items() if row.receive}
"""The radios that have one."""


def receive_command(settings: RadioSettings, center_frequency_hz: float) -> list[str]:
    """Build the argument list of the radio's program; its samples go to stdout.

    Raises
    ------
    ConfigError
        A setting that this radio does not have.
    """
    program = PROGRAMS[_known(settings.kind)]
    gain = (program.default_gain or 0) if settings.gain is None else settings.gain
    lowest, highest = program.gains
    if not lowest <= gain <= highest:
        raise ConfigError(
            f"gain {gain} is not possible with {program.title}",
            remedy=f"Set [radio] gain between {lowest} and {highest}",
        )
    # A stand-in (`program`) may offer any rate.
    if not settings.program and not program.takes_rate(settings.sample_rate_hz):
        raise ConfigError(
            f"{program.title}: it does not take {settings.sample_rate_hz:.0f} samples a second",
            remedy=f"Set [radio] sample_rate_hz to {program.rates_text()}",
        )
    tuned_frequency(settings, center_frequency_hz)
    arguments: list[str] = import_module(program.module).arguments(
        settings, center_frequency_hz, gain
    )
    return [*(settings.program or (program.receive,)), *arguments]


def commands_before(settings: RadioSettings) -> list[list[str]]:
    """List what must be run before the radio's program."""
    if settings.program or settings.kind not in PROGRAMS:
        return []
    module = import_module(PROGRAMS[settings.kind].module)
    before: list[list[str]] = (
        module.commands_before(settings) if hasattr(module, "commands_before") else []
    )
    return before


def _known(kind: str) -> str:
    if kind in PROGRAMS:
        return kind
    raise ConfigError(
        f"unknown radio {kind!r}",
        remedy=f"Set [radio] kind to one of {', '.join(RADIOS)}",
    )
