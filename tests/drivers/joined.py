"""Waiting for threads that compute."""

import threading


def joined(name: str) -> None:
    """Wait until no thread of this name works: that costs what it computes, and no more."""
    for thread in threading.enumerate():
        if thread.name == name:
            thread.join()
