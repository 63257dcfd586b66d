"""The ``uavrt`` command; one module per subcommand, imported when it is called."""

from uavrt.cli.app import main

__all__ = ["main"]
