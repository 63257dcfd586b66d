"""Modules that lie in no package."""

import importlib.util
from pathlib import Path
from types import ModuleType

from some import some


def module_at(path: Path) -> ModuleType:
    """Load the module that a file holds."""
    spec = some(importlib.util.spec_from_file_location(path.name.split(".")[0], path))
    module = importlib.util.module_from_spec(spec)
    some(spec.loader).exec_module(module)
    return module
