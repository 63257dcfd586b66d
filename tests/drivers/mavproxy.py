"""MAVProxy as a ground station that no one here wrote; its console is typed into."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path


def mavproxy(
    port: int, commands: str, directory: Path, *, done: Callable[[], bool], patience_s: float
) -> str:
    """Type commands, wait until what they ask is done; get all that MAVProxy said.

    `port`: UDP port on the loopback where it listens.
    `commands`: a line each.
    `directory`: its home.
    `done`: asked again and again; after `patience_s` seconds the test judges what there is.
    """
    program = subprocess.Popen(
        [
            sys.executable,
            *("-m", "MAVProxy.mavproxy", "--default-modules=link"),
            f"--master=udpin:127.0.0.1:{port}",
            f"--state-basedir={directory}",
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=directory,
        env=os.environ | {"MAVLINK20": "1", "HOME": str(directory)},
    )
    assert program.stdin is not None
    time.sleep(3.0)
    for line in commands.splitlines():
        program.stdin.write(line + "\n")
        program.stdin.flush()
        time.sleep(1.5)
    deadline_s = time.monotonic() + patience_s
    while not done() and time.monotonic() < deadline_s:
        time.sleep(0.2)
    time.sleep(1.0)
    program.terminate()
    said, _ = program.communicate(timeout=10)
    return said
