"""What programs load of SciPy for their transforms."""

import subprocess
import sys

import pytest


def test_a_channelizer_of_all_channels_imports_no_scipy_fft() -> None:
    code = (
        "import sys, numpy as np; from uavrt.dsp.channelizer import Channelizer; "
        "Channelizer(channels=100).process(np.ones(5000, np.complex64)); "
        "sys.exit('scipy.special' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize(
    "module",
    ["drone.processes.detector", "analysis.measure.recorded_pulses", "cli.signals.detect"],
)
def test_the_detection_of_beeping_tags_imports_no_scipy_special(module: str) -> None:
    code = f"import sys, uavrt.{module}; sys.exit('scipy.special' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_guide_loads_no_tools_of_numpy_and_who_asks_for_them_gets_them() -> None:
    code = (
        "import sys, uavrt.drone.processes.guide; "
        "loaded = {'numpy.f2py', 'numpy.testing'} & {*sys.modules}; "
        "import numpy.testing, numpy.f2py; "
        "numpy.testing.assert_equal(numpy.f2py.__name__, 'numpy.f2py'); "
        "sys.exit(len(loaded))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
