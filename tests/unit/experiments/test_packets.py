"""Two logs of one flight, pulse by pulse."""

from pathlib import Path

import pytest

from uavrt.core.errors import FormatError
from uavrt_experiments.packets.matching import match_logs
from uavrt_experiments.packets.model import model_rows

QGC = "CustomPluginLog: PULSE tag_id:frequency_hz:time:snr:confirmed 2 148 {time:.2f} 70.46 1\n"
ROW = (  # thesis, Figure 5.7, one second apart
    "2, 148.71, {second}, 230494976, {second}, 250494957, 0, 0, 0, 0, 69.6484, 0.219541, "
    "1, 69.8253, 1, 1, 47.3978, 8.54561, 488.077, 0.00189066, -0.00109068, 0.71339, 0.700764\n"
)
FIRST = 1_700_205_419


@pytest.fixture
def onboard(tmp_path: Path) -> Path:
    path = tmp_path / "pulse_pose_log.txt"
    path.write_text("".join(ROW.format(second=FIRST + n) for n in range(10)))
    return path


def test_the_thesiss_two_files_are_compared_and_the_missing_pulse_is_named(
    onboard: Path, tmp_path: Path
) -> None:
    ground = tmp_path / "console.txt"
    times = [FIRST + n + 0.230494976 for n in range(10) if n != 4]
    ground.write_text("noise\n" + "".join(QGC.format(time=t) for t in times))
    match = match_logs(onboard, ground)
    assert (match.sent, match.received, match.repeated, match.unknown) == (10, 9, 0, 0)
    (missing,) = match.missing
    assert (missing.tag_id, missing.time_ns) == (2, (FIRST + 4) * 10**9 + 230_494_976)


def test_what_came_twice_or_was_never_sent_is_counted(onboard: Path, tmp_path: Path) -> None:
    ground = tmp_path / "console.txt"
    times = [FIRST + n + 0.230494976 for n in (0, 0, 1, 50)]
    ground.write_text("".join(QGC.format(time=t) for t in times))
    match = match_logs(onboard, ground)
    assert (match.received, match.repeated, match.unknown) == (2, 1, 1)


def test_a_log_that_is_none_is_refused(onboard: Path, tmp_path: Path) -> None:
    with pytest.raises(FormatError):
        match_logs(onboard, tmp_path / "nothing.txt")


def test_the_model_loses_none_where_the_ground_acknowledges() -> None:
    rows = model_rows(pulses=150, losses=(0.0, 0.2))
    assert len(rows) == 8
    for row in rows:
        assert row.dropped_by_autopilot == row.dropped_by_radio == 0
        if row.acknowledged or row.loss == 0.0:
            assert row.received == row.sent == 150
        else:
            assert row.received < 150
