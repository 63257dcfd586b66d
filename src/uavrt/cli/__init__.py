"""The ``uavrt`` command; one module per subcommand, imported when it is called.

Nothing is imported here: until `uavrt.cli.__main__` runs, Ctrl-C leaves Python's traceback.
"""


def __getattr__(name: str) -> object:
    if name == "main":
        from uavrt.cli.__main__ import main

        return main
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
