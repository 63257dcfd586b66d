"""Raw captures at a hundred kills and full disks: all that was recorded is kept, and said."""

import re
import time
from pathlib import Path
from random import Random

import pytest
from captures import CapturingDrone
from radio_world import needs

MOMENTS = 100
CAPTURE_S = 2.0


@pytest.mark.timeout(3600)
def test_all_that_was_recorded_is_in_valid_files_and_said(tmp_path: Path) -> None:
    needs("rtlsdr")
    random = Random(7)
    drone = CapturingDrone(tmp_path, CAPTURE_S)
    short: list[float] = []
    restarts = 0

    def disturb(drone: CapturingDrone) -> None:
        """Kill a process or fill the disk, at any moment."""
        what = random.choice(("receiver", "receiver", "recorder", "supervisor", "disk", "disk"))
        drone.wait_for_samples()
        time.sleep(random.uniform(0.0, CAPTURE_S))
        if what == "disk":
            drone.world.write("free_mb", random.choice(("0", "0.9")))
        elif what == "supervisor":
            drone.kill_supervisor()
        else:
            drone.kill_process(what)

    for moment in range(MOMENTS):
        texts = drone.capture(disturb)
        said = [text for text in texts if text.startswith("Raw capture")][-1]
        found = re.match(r"Raw capture: ([\d.]+) of 2 s in (\S+)", said)
        recorded_s = drone.recorded_s()
        if any("ended by a restart: kept in" in text for text in texts):
            assert recorded_s > 0.0, (moment, texts)
            restarts += 1
            continue
        assert found or ("failed" in said and recorded_s == 0.0), (moment, texts)
        said_s = float(found[1]) if found else 0.0
        assert said_s == pytest.approx(recorded_s, abs=0.051), (moment, texts)
        short += [said_s] if said_s < CAPTURE_S else []
        (drone.world.directory / "free_mb").unlink(missing_ok=True)
    print(f"{MOMENTS} captures, {restarts} ended by a restart, {len(short)} short: {short}")
    drone.close()
