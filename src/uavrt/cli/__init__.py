"""The ``uavrt`` command; one module per subcommand, imported when it is called."""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.cli.__main__ import main as main

__all__, __getattr__ = lazily(__name__, {"__main__": "main"})
