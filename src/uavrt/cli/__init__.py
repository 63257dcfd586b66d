"""The ``uavrt`` command; one module per subcommand, imported when it is called."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.cli.__main__ import main

__all__ = [
    "main",
]
__getattr__ = lazily(
    __name__,
    {
        "main": "__main__",
    },
)
