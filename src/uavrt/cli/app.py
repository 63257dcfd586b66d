"""Command line: subcommands by name, errors as plain sentences, exit codes."""

import sys

from cyclopts import App, CycloptsError, CycloptsPanel, MissingArgumentError, Parameter
from rich.console import Console

import uavrt
from uavrt.cli.command_places import module_of
from uavrt.cli.examples import examples
from uavrt.cli.registries import fill_help
from uavrt.cli.shown.notices import notice, warn
from uavrt.cli.shown.terminal_text import guard_terminals, harmless
from uavrt.core.errors import UavrtError

COMMANDS = {
    "demo": "Run the whole system on this machine, with simulated animals.",
    "run": "Run the drone side: radio, detectors, autopilot link, recorder.",
    "ground": "Run the ground station, as a page in the browser or for scripts.",
    "fly": "Move the drone; you confirm each motion.",
    "detect": "Find pulses in a recording or a live stream.",
    "bearing": "Estimate bearings from a flight or a pulse log.",
    "localize": "Estimate positions from a flight or from bearings.",
    "integrate": "Find tags below the noise in a whole flight.",
    "range": "Predict the detection range of a tag before a flight.",
    "coverage": "Map where a tag is detected, before a flight or after it.",
    "batch": "Find pulses in all recordings of an archive; write Parquet tables.",
    "archive": "Query and export an archive that uavrt batch has searched.",
    "attach": "Add poses from an autopilot's log to pulses without poses.",
    "report": "Write a report on a flight, to read and share.",
    "season": "Summarise a folder of flights: minutes, animals, batteries.",
    "export": "Write a flight as files for other programs.",
    "fetch": "Copy flights from the drone over the radio link.",
    "tags": "Check, convert and measure tags.",
    "simulate": "Record a simulated world: samples, telemetry and truth.",
    "channelize": "Split a band into channels and send them by UDP.",
    "monitor": "Watch a running system in a terminal.",
    "doctor": "Check this computer for problems, with remedies.",
    "service": "Start the drone side at boot.",
    "starter": "Add the ground station to the desktop's menu.",
    "update": "Install another version offline; go back if it fails.",
}
"""Description of each command by its name, which is also that of its module and function."""


def make_app(*, summaries: bool = False, added: bool = False) -> App:
    """Create the command line with all commands.

    `summaries`: use the texts of `COMMANDS` without importing the commands. `added`: include
    the commands of other packages.
    """
    made = App(
        name="uavrt",
        help=uavrt.__doc__,
        version=uavrt.__version__,
        default_parameter=Parameter(negative_iterable=(), show_default=_default),
    )
    for place, (name, text) in enumerate(COMMANDS.items()):
        below = examples(name)
        more = {} if below is None else {"help_epilogue": below}
        made.command(
            f"{module_of(name)}:{name}",
            help=text if summaries else None,
            sort_key=place,
            **more,
        )
    if added:
        from importlib.metadata import entry_points

        for entry in sorted(entry_points(group="uavrt.cli_commands"), key=lambda one: one.name):
            if entry.name not in COMMANDS:
                made.command(entry.load(), name=entry.name)
    return made


def _default(value: object) -> str | None:
    """Default of an option as shown in its help; None for off, None and empty values."""
    if value is None or value is False or value in ("", ()):
        return None
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


app = make_app()


def run() -> None:
    """Run ``uavrt``; an expected error is printed without a traceback, with exit status 2."""
    guard_terminals()
    try:
        arguments = sys.argv[1:]
        called = bool(arguments) and arguments[0] in COMMANDS
        chosen = app if called else make_app(summaries=True, added=True)
        if called and not {"--help", "-h"}.isdisjoint(arguments):
            fill_help(arguments[0])
        chosen(arguments, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        _print_fault(error)
        sys.exit(2)
    except UavrtError as error:
        notice(harmless(f"uavrt: {error}"))
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except MemoryError:
        warn("not enough memory. Do less at a time")
        sys.exit(2)
    except BrokenPipeError:
        # The reader of our output went away (`uavrt detect … | head`).
        sys.stderr.close()
        sys.exit(141)
    except OSError as error:
        # Where a place is not checked before: still no traceback for a full disk.
        place = "" if error.filename is None else f"{error.filename}: "
        warn(
            f"{place}{error.strerror or error}. Check the name, the permissions and "
            "the space left"
        )
        sys.exit(2)


def _print_fault(error: CycloptsError) -> None:
    argument = error.argument
    if not isinstance(error, MissingArgumentError) or argument is None:
        Console(stderr=True).print(CycloptsPanel(error))
        return
    command = " ".join(("uavrt", *(error.command_chain or ())))
    name = argument.name.lstrip("-").upper().replace("-", "_")
    option = argument.index is None
    missing, given = (argument.name, f"… {argument.name} VALUE") if option else (name, name)
    warn(f"{missing} is missing: {command} {given}. See {command} --help")
