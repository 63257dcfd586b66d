"""Raw captures keep and name what was recorded: killed, on a full disk, with little room.

The real processes with rtl_sdr over a stand-in library. A hundred such moments:
`tests/claims/test_raw_captures.py`.
"""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from captures import BYTES_A_SECOND, CapturingDrone
from radio_world import needs

CAPTURE_S = 2.0


@pytest.fixture(scope="module")
def drone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CapturingDrone]:
    needs("rtlsdr")
    running = CapturingDrone(tmp_path_factory.mktemp("capture"), CAPTURE_S)
    yield running
    running.close()


@pytest.fixture(autouse=True)
def room_again(drone: CapturingDrone) -> Iterator[None]:
    yield
    (drone.world.directory / "free_mb").unlink(missing_ok=True)


def said_s(texts: list[str]) -> float:
    """Seconds that the last text says were recorded."""
    found = re.match(r"Raw capture: ([\d.]+) of 2 s in (\S+)", texts[-1])
    assert found, texts
    assert Path(found[2].rstrip(":,")).exists()
    return float(found[1])


def in_time(
    drone: CapturingDrone,
    disturb: Callable[[CapturingDrone], object],
    disturbed: Callable[[list[str]], bool],
) -> list[str]:
    """Disturb a capture; again where a busy computer was too early or too late for it."""
    for _ in range(5):
        texts = drone.capture(disturb)
        if disturbed(texts):
            break
        (drone.world.directory / "free_mb").unlink(missing_ok=True)
    return texts


def test_a_whole_capture_is_named_with_its_file(drone: CapturingDrone) -> None:
    texts = drone.capture(lambda _: None)
    assert said_s(texts) == CAPTURE_S == drone.recorded_s()
    assert texts[-1].endswith("/iq/capture_1.sigmf-data")


def test_a_killed_receiver_records_the_rest_in_another_file(drone: CapturingDrone) -> None:
    def kill(drone: CapturingDrone) -> None:
        drone.wait_for_samples()
        drone.kill_process("receiver")

    texts = in_time(drone, kill, lambda texts: texts[-1].endswith(" files"))
    assert said_s(texts) == CAPTURE_S == drone.recorded_s()
    assert texts[-1].endswith("/iq, 2 files")


def test_what_does_not_fit_is_said_at_once_and_the_capture_ends_in_time(
    drone: CapturingDrone,
) -> None:
    free_mb = 1.0 + 1.2 * BYTES_A_SECOND * 1e-6
    drone.world.write("free_mb", str(free_mb))
    texts = drone.capture(lambda _: None)
    assert any("Disk: 1 of 2 s fit, the capture ends early" in text for text in texts)
    assert said_s(texts) == pytest.approx(1.2, abs=0.05) == drone.recorded_s()
    assert texts[-1].endswith(": the disk is nearly full")


def test_a_disk_that_fills_up_ends_the_capture_and_keeps_what_there_is(
    drone: CapturingDrone,
) -> None:
    def fill(drone: CapturingDrone) -> None:
        drone.wait_for_samples()
        drone.world.write("free_mb", "0")

    texts = in_time(
        drone, fill, lambda texts: " of 2 s in" in texts[-1] and said_s(texts) < CAPTURE_S
    )
    assert 0.2 < said_s(texts) < CAPTURE_S
    assert said_s(texts) == pytest.approx(drone.recorded_s(), abs=0.051)
    assert "No space left on device" in texts[-1] or "the disk is nearly full" in texts[-1]


def test_a_killed_supervisor_goes_on_with_the_capture(drone: CapturingDrone) -> None:
    def kill(drone: CapturingDrone) -> None:
        drone.wait_for_samples()
        drone.kill_supervisor()

    texts = drone.capture(kill)
    assert said_s(texts) == CAPTURE_S == drone.recorded_s()
