"""Files of automated telemetry: read as they are written elsewhere, damaged ones too."""

import gzip
import math
import tracemalloc
from pathlib import Path

import pytest

from uavrt.core.errors import FormatError
from uavrt.core.foreign import TEXT_LOG
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.formats.text import read_lines

# As a SensorGnome of 2016 writes: quotes, a C line, two ports, letters in a port's name.
PULSES = """\
C,1466440990.1,6,0.000001
G,1466441000,44.3405,-66.1185,21.7
S,1466441001.5,1,"frequency",166.376,0,
S,1466441001.5,2,-m,166.376,0,
p1,1466441002.0000,4.056,-44.4,-50.55
p1,1466441002.0220,4.060,-44.1,-50.60,0.3
pA2,1466441002.0222,4.055,-46.0,-52.0
what is this
p1,1466441002.07
G,1466441004,44.3407,-66.1185,23.7
"""


@pytest.mark.parametrize("packed", [False, True])
def test_a_sensorgnomes_pulses_are_read_with_their_places(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "site-1-2016.txt.gz"
    path.write_bytes(gzip.compress(PULSES.encode()) if packed else PULSES.encode())
    log = read_pulse_log(path)
    assert (log.kind, log.passed_over) == ("sensorgnome", 1)
    assert [one.pulse.start_time_ns % 10**12 for one in log.pulse_poses] == [
        441_002_000_000_000 % 10**12,
        441_002_022_000_000 % 10**12,
        441_002_022_200_000 % 10**12,
    ]
    first = log.pulse_poses[0]
    assert first.pulse.frequency_hz == pytest.approx(166_380_056.0)
    assert first.pulse.snr_db == pytest.approx(6.15)
    assert {one.pulse.tag_id for one in log.pulse_poses} == {1}
    assert first.pose is not None
    assert first.pose.latitude_deg == pytest.approx(44.3406)
    assert first.pose.altitude_relative_m == pytest.approx(1.0)
    assert any("no headings" in text for text in log.warnings)
    assert any("damaged" in text for text in log.warnings)


def test_pulses_without_a_tuned_frequency_and_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("p1,1466441002.0,4.0,-44,-50\n" * 3)
    with pytest.raises(FormatError, match="line 1: no earlier S line"):
        read_pulse_log(path)
    path.write_bytes(gzip.compress(PULSES.encode() * 50)[:-40])
    with pytest.raises(FormatError, match="damaged"):
        read_pulse_log(path)


def test_detections_are_read_whatever_columns_stand_between(tmp_path: Path) -> None:
    path = tmp_path / "d.csv"
    path.write_text(
        '"ts","id","runID","sig","noise","freq","nomFreq","lat","lon","alt"\n'
        "1466441002.25,12,1,-44.5,-60.5,4.1,166.38,44.34,-66.11,\n"
        "1466441007.50,12,1,-45,,,,,,\n"
        "14664410"
    )
    log = read_pulse_log(path)
    assert log.kind == "detections"
    one, two = log.pulse_poses
    assert (one.pulse.tag_id, one.pulse.confirmed) == (12, True)
    assert one.pulse.snr_db == pytest.approx(16.0)
    assert one.pulse.frequency_hz == pytest.approx(166_384_100.0)
    assert one.pose is not None
    assert math.isnan(one.pose.altitude_amsl_m)
    assert two.pose is None
    path.write_text("ts,id,sig\n1466441002.25,-3,5\n1466441002.5,1,5\n")
    with pytest.raises(FormatError, match="line 2: the tag id -3"):
        read_pulse_log(path)


@pytest.mark.parametrize("end", [b"\n", b"\r"])
def test_a_file_of_line_ends_alone_is_not_unpacked_whole(tmp_path: Path, end: bytes) -> None:
    path = tmp_path / "lines.txt.gz"
    with gzip.open(path, "wb", 1) as packed:
        for _ in range(10 * TEXT_LOG.values // 2**20):
            packed.write(end * 2**20)
    tracemalloc.start()
    try:
        with pytest.raises(FormatError, match="too large to be a log"):
            read_lines(path)
        assert tracemalloc.get_traced_memory()[1] < 5 * TEXT_LOG.values
    finally:
        tracemalloc.stop()
