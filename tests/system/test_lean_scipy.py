"""Processes of the drone load SciPy without the tools of NumPy that it imports."""

import subprocess
import sys

import pytest

TOOLS = "'numpy.f2py', 'numpy.testing'"


@pytest.mark.parametrize(
    "module",
    [
        "localization.estimates.flight_estimates",
        "drone.processes.estimator",
        "drone.processes.guide",
    ],
)
def test_a_process_of_the_drone_loads_no_tools_of_numpy(module: str) -> None:
    code = (
        f"import sys, uavrt.{module}; sys.exit(any(name in sys.modules for name in [{TOOLS}]))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_tools_are_the_true_ones_when_they_are_used_later() -> None:
    code = (
        "import numpy as np; from uavrt.core.runtime.lean_scipy import fft, special\n"
        "np.testing.assert_allclose(special.ndtr(0.0), 0.5); np.f2py.get_include()\n"
        "np.testing.assert_allclose(fft.irfft(fft.rfft([1.0, 2.0])), [1.0, 2.0])"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
