"""The command line's frame: subcommands by name, errors in plain words, exit codes."""

import sys

from cyclopts import App

import uavrt
from uavrt.errors import UavrtError

app = App(
    name="uavrt",
    help=uavrt.__doc__,
    version=uavrt.__version__,
)
# Named as text: a command's module is imported when the command is called.
app.command("uavrt.cli.demo:demo")
app.command("uavrt.cli.run:run")
app.command("uavrt.cli.ground:ground")
app.command("uavrt.cli.detect:detect")
app.command("uavrt.cli.simulate:simulate")
app.command("uavrt.cli.bearing:bearing")
app.command("uavrt.cli.localize:localize")
app.command("uavrt.cli.channelize:channelize")
app.command("uavrt.cli.export:export")
app.command("uavrt.cli.fetch:fetch")
app.command("uavrt.cli.report:report")
app.command("uavrt.cli.tags:tags")
app.command("uavrt.cli.experiment:experiment")
app.command("uavrt.cli.monitor:monitor")
app.command("uavrt.cli.doctor:doctor")
app.command("uavrt.cli.service:service")


def main() -> None:
    """Run ``uavrt``; a deliberate error is printed without a traceback and exits with 2."""
    try:
        app(sys.argv[1:])
    except UavrtError as error:
        print(f"uavrt: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader of our output went away (`uavrt detect … | head`).
        sys.stderr.close()
        sys.exit(141)
