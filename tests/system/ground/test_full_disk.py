"""A ground station whose disk fills up acknowledges what it has stored, and nothing else.

Each moment is one trial: a stream of pulses, a disk that is full from then on, SIGKILL a little
later; then there is room, and what was not acknowledged comes again. A few moments here,
`UAVRT_FULL_DISKS=200` for the campaign. Where this program may mount, the disk is a small one
that is really full; elsewhere the kernel lets no file grow (RLIMIT_FSIZE).
"""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest
from forked import forked
from pulse_stream import StreamingDrone, limit_files, line_keys, serve, stored_keys
from some import some

from uavrt.simulation.demo.demo_programs import free_udp_port

MOMENTS = int(os.environ.get("UAVRT_FULL_DISKS", "4"))
DISK_MB = 4
STREAM_S, GAP_S = 1.2, 0.02
AGAIN_S = 30.0


@pytest.fixture
def streaming() -> Iterator[Callable[[int, int], StreamingDrone]]:
    drones: list[StreamingDrone] = []

    def make(port: int, seed: int) -> StreamingDrone:
        drones.append(StreamingDrone(port, seed))
        return drones[-1]

    yield make
    for drone in drones:
        drone.close()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path | None]:
    """A disk of some megabytes; None where nobody may mount."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "tmpfs", str(place)]
    mounted = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    yield place if mounted else None
    if mounted:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def fill(disk: Path, random: Random) -> None:
    """Leave no room, or so little that a record is cut."""
    slack = random.choice((0, 0, 1, 3, 9)) * 4096
    with (disk / "filler").open("wb", buffering=0) as file:
        with suppress(OSError):
            while file.write(bytes(4096)) == 4096:
                pass
        file.truncate(max(0, file.tell() - slack))


def stop_growth(directory: Path, pid: int, random: Random) -> None:
    """Let no file of the station grow beyond a random size."""
    largest = max((path.stat().st_size for path in directory.rglob("*")), default=0)
    limit_files(pid, random.choice((0, random.randrange(largest + 1), largest)))


@pytest.mark.timeout(120 + 60 * MOMENTS)
@pytest.mark.parametrize("kind", ["headless", "page"])
def test_all_that_is_acknowledged_is_stored_and_the_rest_when_it_comes_again(
    kind: str,
    streaming: Callable[[int, int], StreamingDrone],
    small_disk: Path | None,
    tmp_path: Path,
) -> None:
    held_back = 0
    for number in range(MOMENTS // 2):
        random = Random(f"{kind}{number}")
        place = (small_disk or tmp_path) / f"moment-{number}"
        drone = streaming(port := free_udp_port(), random.randrange(10**6))
        station = forked(serve, kind, port, place)
        drone.detect()
        assert drone.run(AGAIN_S, drone.all_acknowledged), "it listens"
        full_at, after = (round(random.uniform(0.0, STREAM_S) / GAP_S) for _ in range(2))
        for step in range(full_at + after + 1):
            if step == full_at:
                if small_disk is None:
                    stop_growth(place, some(station.pid), random)
                else:
                    fill(small_disk, random)
            drone.detect()
            drone.run(GAP_S)
        station.kill()
        station.join()
        told = f"{kind}, moment {number}"
        if small_disk is not None:
            (small_disk / "filler").unlink(missing_ok=True)
        acknowledged = {drone.keys[one] for one in drone.acknowledged}
        assert acknowledged <= set(stored_keys(place)), told
        held_back += len(drone.keys) - len(acknowledged)
        station = forked(serve, kind, port, place)
        assert drone.run(AGAIN_S, drone.all_acknowledged), told
        station.kill()
        station.join()
        assert set(stored_keys(place)) == set(drone.keys.values()), told
        if kind == "headless":
            assert sorted(line_keys(place)) == sorted(drone.keys.values()), told
        shutil.rmtree(place)
    assert held_back > MOMENTS, "the disks were full"
