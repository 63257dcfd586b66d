"""Programs that are asked before a radio is started share one time limit."""

import stat
import sys
from pathlib import Path

import pytest

from uavrt.config.settings import RadioSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RadioStalled
from uavrt.radio.opening import open_radio
from uavrt.radio.receivers import radio_program as program


def test_programs_that_answer_slowly_one_after_the_other_end_within_one_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of them alone would answer in time; a receiver silent for 5 s is killed."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(program, "_INFORMATION_S", 1.5)
    for name in ("rtl_sdr", "rtl_biast"):
        path = tmp_path / name
        path.write_text(f"#!{sys.executable}\nimport time\ntime.sleep(1.2)\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    begun_s = monotonic_s()
    with pytest.raises(RadioStalled, match="rtl_biast does not answer"):
        open_radio(RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, serial="7"), 148e6)
    assert monotonic_s() - begun_s < 2.3
