"""Load modules that belong to no package."""

import importlib.util
from pathlib import Path
from types import ModuleType

from some import some


def module_at(path: Path) -> ModuleType:
    """Load a file as a module."""
    spec = some(importlib.util.spec_from_file_location(path.name.split(".")[0], path))
    module = importlib.util.module_from_spec(spec)
    some(spec.loader).exec_module(module)
    return module
