"""Check whether this computer can show the ground station's page."""

import os
import sys
from importlib.util import find_spec


def has_screen() -> bool:
    """True if a browser could open a window on this computer."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def has_page() -> bool:
    """True if the extra ``uavrt[ground]`` is installed."""
    return all(find_spec(name) for name in ("starlette", "uvicorn", "websockets"))
