"""What a program loads: each library costs it time at the start, and memory for as long."""

import pytest
from command_line import python

NUMPY_TOOLS = ("numpy.f2py", "numpy.testing")
"""SciPy imports them, and no program needs them."""


def loaded(code: str, *names: str) -> list[str]:
    """Those of some modules that a program has loaded by some code."""
    tell = f"import sys\nprint(*set({names}) & sys.modules.keys())"
    return python("-c", f"{code}\n{tell}", check=True).stdout.split()


@pytest.mark.parametrize(
    ("module", "names"),
    [
        ("config", ["pydantic"]),
        ("drone.supervisor.supervisor_program", ["numpy", "rich"]),
        ("drone.processes.recorder", ["numpy", "rich"]),
        ("drone.processes.detector", ["scipy.special"]),
        ("analysis.measure.recorded_pulses", ["scipy.special"]),
        ("cli.signals.detect", ["scipy.special"]),
        ("drone.processes.estimator", NUMPY_TOOLS),
        ("drone.processes.guide", NUMPY_TOOLS),
        ("ground.web.page_program", ["scipy.stats"]),
    ],
)
def test_a_program_loads_no_library_that_it_can_do_without(
    module: str, names: list[str]
) -> None:
    assert loaded(f"import uavrt.{module}", *names) == []


def test_a_channelizer_of_all_channels_imports_no_scipy_fft() -> None:
    code = (
        "import numpy as np; from uavrt.dsp.channelizer import Channelizer\n"
        "Channelizer(channels=100).process(np.ones(5000, np.complex64))"
    )
    assert loaded(code, "scipy.special") == []


def test_the_tools_of_numpy_are_the_true_ones_when_they_are_used_later() -> None:
    code = (
        "import numpy as np; from uavrt.core.runtime.lean_scipy import fft, special\n"
        "np.testing.assert_allclose(special.ndtr(0.0), 0.5); np.f2py.get_include()\n"
        "np.testing.assert_allclose(fft.irfft(fft.rfft([1.0, 2.0])), [1.0, 2.0])\n"
        "import numpy.f2py; np.testing.assert_equal(numpy.f2py.__name__, 'numpy.f2py')"
    )
    python("-c", code, check=True)
