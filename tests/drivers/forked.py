"""Work in a child process that is a copy of the test, to be killed or to have limits."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from typing import Any

FORK = multiprocessing.get_context("fork")


def forked(work: Callable[..., object], *given: Any) -> BaseProcess:
    """Start work in a child, which can be killed."""
    child = FORK.Process(target=work, args=given, daemon=True)
    child.start()
    return child


def in_child(work: Callable[..., Any], *given: Any) -> Any:
    """Do work in a child; what it returns or raises."""
    with FORK.Pool(1) as pool:
        return pool.apply(work, given)
