"""A SensorGnome begins a file each hour; only the first after its start has S lines."""

from pathlib import Path

import pytest

from uavrt.analysis.tracks.recognised import read_track
from uavrt.core.errors import FormatError
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.formats.tracks.track import STANDING

BEGIN = 1_700_000_000
START = "S,1699990000,1,-m,166.376,0,\n"
HOUR = "".join(f"p1,{BEGIN + at}.5,4.0,-60,-80\n" for at in range(0, 3600, 60))


def places(*north_deg: float) -> str:
    return "".join(
        f"G,{BEGIN + 300 * number},{47.0 + north},8.0,500\n"
        for number, north in enumerate(north_deg)
    )


def test_an_hour_takes_its_frequency_from_the_first_file_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "boot-all.txt").write_text(START + "p1,1699990001,4.0,-60,-80\n")
    path = tmp_path / "hour.txt"
    path.write_text(HOUR)
    log = read_pulse_log(path)
    assert {one.pulse.frequency_hz for one in log.pulse_poses} == {166_380_000.0}
    assert any("166.376 MHz, is that of boot-all.txt" in text for text in log.warnings)
    own = read_pulse_log(tmp_path / "boot-all.txt")
    assert not any("no S line" in text for text in own.warnings)


def test_the_last_tuning_before_an_hour_of_the_same_start_counts(tmp_path: Path) -> None:
    hours = (("08", START), ("09", ""), ("10", START.replace("166.376", "150.1")), ("11", ""))
    for hour, tuning in hours:
        (tmp_path / f"site-1-12-2026-08-01T{hour}-00-all.txt").write_text(tuning + HOUR)
    (tmp_path / "site-1-13-2026-08-02T08-00-all.txt").write_text(START + HOUR)
    for hour, mhz in (("08", 166.376), ("09", 166.376), ("10", 150.1), ("11", 150.1)):
        log = read_pulse_log(tmp_path / f"site-1-12-2026-08-01T{hour}-00-all.txt")
        assert log.pulse_poses[0].pulse.frequency_hz == pytest.approx(1e6 * mhz + 4000.0)


def test_files_that_disagree_about_the_frequency_give_none(tmp_path: Path) -> None:
    for name, mhz in (("a.txt", "166.376"), ("b.txt", "150.1")):
        (tmp_path / name).write_text(START.replace("166.376", mhz) + HOUR)
    path = tmp_path / "hour.txt"
    path.write_text(HOUR)
    with pytest.raises(FormatError, match="Put the first file after the receiver's start"):
        read_pulse_log(path)


@pytest.mark.parametrize(
    ("north_deg", "placed"),
    [((0.0, 1e-4, -1e-4, 0.0), 60), ((0.0, 0.001, 0.002, 0.003), 7)],
    ids=["standing", "moving"],
)
def test_positions_that_agree_hold_for_the_whole_hour(
    tmp_path: Path, north_deg: tuple[float, ...], placed: int
) -> None:
    path = tmp_path / "hour.txt"
    path.write_text(START + places(*north_deg) + HOUR)
    assert sum(one.pose is not None for one in read_pulse_log(path).pulse_poses) == placed


@pytest.mark.parametrize(("last_deg", "poses"), [(47.0001, 4621), (47.01, 0)])
def test_a_track_that_does_not_move_gives_places_without_heading(
    tmp_path: Path, last_deg: float, poses: int
) -> None:
    path = tmp_path / "station.gpx"
    points = "".join(
        f'<trkpt lat="{lat}" lon="8.0"><ele>500</ele><time>2023-11-14T{clock}Z</time></trkpt>'
        for lat, clock in ((47.0, "22:13:00"), (last_deg, "23:30:00"))
    )
    path.write_text(f"<gpx><trk><trkseg>{points}</trkseg></trk></gpx>")
    if not poses:
        with pytest.raises(FormatError, match="has no attitude"):
            read_track(path)
        return
    track = read_track(path)
    assert len(track.positions) == len(track.attitudes) == poses
    assert track.warnings == (STANDING,)
