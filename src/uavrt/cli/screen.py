"""Display capabilities of this computer."""

import os
import sys
from importlib.util import find_spec


def has_screen() -> bool:
    """True if a browser could open a window."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def has_page() -> bool:
    """True if the extra ``uavrt[ground]`` is installed."""
    return all(find_spec(name) for name in ("starlette", "uvicorn", "websockets"))
