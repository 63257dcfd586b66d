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
    "module", ["processes.detector", "analysis.measure.recorded_pulses", "cli.detect"]
)
def test_the_detection_of_beeping_tags_imports_no_scipy_special(module: str) -> None:
    code = f"import sys, uavrt.{module}; sys.exit('scipy.special' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
