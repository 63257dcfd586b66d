"""Logging: short facts with keys, one JSON object a line on stderr.

The supervisor collects the lines of all its children. On a terminal the lines are coloured text
instead. Levels: info is what an operator would tell a colleague; warning and above also reach
the ground as status texts.
"""

import logging
import sys

import structlog


def configure_logging(process: str, *, level: int = logging.INFO) -> None:
    """Send log events of this process to stderr; bind its name to each of them."""
    renderer: structlog.types.Processor = (
        structlog.dev.ConsoleRenderer()
        if sys.stderr.isatty()
        else structlog.processors.JSONRenderer()
    )
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.PrintLoggerFactory(file=sys.stderr),
        cache_logger_on_first_use=True,
    )
    structlog.contextvars.bind_contextvars(process=process)


def get_logger() -> structlog.typing.FilteringBoundLogger:
    """Get the logger: ``log.warning("samples lost", count=…)``."""
    logger: structlog.typing.FilteringBoundLogger = structlog.get_logger()
    return logger
