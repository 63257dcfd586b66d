"""Programs that are asked before a radio is started share one time limit."""

import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from uavrt.config.settings import RadioSettings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import RadioStalled
from uavrt.radio.opening import open_radio
from uavrt.radio.receivers import radio_program as program

LIMIT_S = 60.0


def test_programs_that_answer_slowly_one_after_the_other_end_within_one_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of them alone would answer in time; a receiver silent for 5 s is killed.

    The first seems to take all but half a second of the limit.
    """
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(program, "_INFORMATION_S", LIMIT_S)
    for name, seconds in (("rtl_sdr", 0), ("rtl_biast", 0.9 * LIMIT_S)):
        path = tmp_path / name
        path.write_text(f"#!{sys.executable}\nimport time\ntime.sleep({seconds})\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    ends_s, run = monotonic_s() + LIMIT_S - 0.5, subprocess.run

    def slow(command: list[str], **options: Any) -> Any:
        done = run(command, **options)
        late_s = ends_s - monotonic_s()
        monkeypatch.setattr(program, "monotonic_s", lambda: monotonic_s() + late_s)
        return done

    monkeypatch.setattr(subprocess, "run", slow)
    begun_s = monotonic_s()
    with pytest.raises(RadioStalled, match="rtl_biast does not answer"):
        open_radio(RadioSettings(kind="rtlsdr", sample_rate_hz=250e3, serial="7"), 148e6)
    assert monotonic_s() - begun_s < 0.5 * LIMIT_S
