"""The ``uavrt`` command; one module per subcommand, imported when it is called.

This module imports nothing, because Ctrl-C shows a traceback until `uavrt.cli.__main__` runs.
"""


def __getattr__(name: str) -> object:
    if name == "main":
        from uavrt.cli.__main__ import main

        return main
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
