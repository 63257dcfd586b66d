"""SciPy is loaded also where it cannot do without the tools of NumPy."""

import importlib
import sys
from types import ModuleType

import numpy as np
import pytest

from uavrt.core.runtime import lean_scipy


def test_a_scipy_that_needs_the_tools_gets_them(monkeypatch: pytest.MonkeyPatch) -> None:
    real, had_them = importlib.import_module, []

    def load(name: str) -> ModuleType:
        had_them.append(hasattr(np.testing, "assert_allclose"))
        if not had_them[-1]:
            raise ImportError("cannot import name 'assert_allclose' from 'numpy.testing'")
        return real(name)

    monkeypatch.setattr(np, "testing", np.testing)
    monkeypatch.delitem(sys.modules, "numpy.testing")
    monkeypatch.setattr(importlib, "import_module", load)
    assert lean_scipy.special.ndtr(0.0) == 0.5
    assert had_them[:2] == [False, True]  # further ones are of SciPy itself


def test_other_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="stats"):
        _ = lean_scipy.stats
