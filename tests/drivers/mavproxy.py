"""MAVProxy as a ground station that no one here wrote; its console is typed into."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from some import some
from until import until

AGAIN_S = 20.0
"""After which the commands are typed again: a busy MAVProxy may have lost one."""


def mavproxy(
    port: int, commands: str, directory: Path, *, done: Callable[[], bool], patience_s: float
) -> str:
    """Type commands until what they ask is done; get all that MAVProxy said.

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
    console, output = some(program.stdin), some(program.stdout)
    said: list[str] = []
    reading = threading.Thread(target=lambda: said.extend(iter(lambda: output.read(1), "")))
    reading.start()
    deadline_s = time.monotonic() + patience_s
    try:
        until(lambda: "Detected vehicle" in "".join(said), patience_s)
        while not done() and time.monotonic() < deadline_s:
            for line in commands.splitlines():
                console.write(line + "\n")
                console.flush()
                time.sleep(1.5)
            again_s = time.monotonic() + AGAIN_S
            while not done() and time.monotonic() < min(again_s, deadline_s):
                time.sleep(0.2)
        time.sleep(1.0)
    finally:
        program.terminate()
        console.close()
        program.wait(30.0)
        reading.join()
        output.close()
    return "".join(said)
