"""Ctrl-C while the command line is still being imported."""

import os
import signal
import subprocess
from pathlib import Path

import pytest
from command_line import launched

SLOW_IMPORT = "import time\nprint('begun', flush=True)\ntime.sleep(60)"
STARTS = [["-m", "uavrt.cli"], ["-c", "from uavrt.cli.__main__ import main; main()"]]


@pytest.mark.parametrize("start", STARTS, ids=["module", "script"])
@pytest.mark.parametrize("imported", ["typing", "cyclopts"], ids=["first", "later"])
def test_a_stop_among_the_imports_ends_without_a_traceback(
    start: list[str], imported: str, tmp_path: Path
) -> None:
    (tmp_path / f"{imported}.py").write_text(SLOW_IMPORT)
    began = launched(
        *(*start, "detect"),
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert began.stdout is not None
    assert began.stdout.readline() == "begun\n"
    began.send_signal(signal.SIGINT)
    _, output = began.communicate(timeout=30)
    assert output == ""
    assert began.returncode == -signal.SIGINT


LOSES_THE_FIRST = """
import os, signal, time
from uavrt.cli import __main__, app

class Lossy:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass

def run():
    Lossy()  # Python discards what is raised in __del__
    time.sleep(60)

app.run = run
__main__.main()
"""


SENT_TOO_SOON = """
import threading, time

class Late(threading.Timer):
    late = [0.5]

    def start(self):
        super().start()
        time.sleep(self.late.pop() if self.late else 0.0)

threading.Timer = Late
"""
"""The main thread of a busy computer goes on only after the second signal was sent."""


@pytest.mark.parametrize("before", ["", SENT_TOO_SOON], ids=["at leisure", "busy"])
def test_a_stop_that_python_discards_ends_the_program_all_the_same(before: str) -> None:
    began = launched(
        "-c",
        before + LOSES_THE_FIRST,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    _, output = began.communicate(timeout=30)
    assert output == ""
    assert began.returncode == 128 + signal.SIGINT
