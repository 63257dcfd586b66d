"""What processes say is kept, within bounds."""

from pathlib import Path

from uavrt.drone.supervisor.tree.child_output import ProcessLog
from uavrt.flight.flight_layout import FlightLayout


def test_lines_are_kept_and_ended(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "new" / "receiver.log")
    log.write("one")
    log.write("two\nthree\n")
    assert (tmp_path / "new" / "receiver.log").read_text() == "one\ntwo\nthree\n"


def test_size_is_bounded_and_the_newest_lines_stay(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "a.log", max_bytes=100, kept_files=2)
    for number in range(1000):
        log.write(f"line {number}")
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["a.log", "a.log.1", "a.log.2"]
    assert all(path.stat().st_size <= 100 for path in tmp_path.iterdir())
    kept = "".join((tmp_path / name).read_text() for name in ("a.log.2", "a.log.1", "a.log"))
    numbers = [int(line.split()[1]) for line in kept.splitlines()]
    assert numbers == list(range(numbers[0], 1000))
    assert len(numbers) >= 20


def test_a_line_longer_than_the_file_is_kept_whole(tmp_path: Path) -> None:
    log = ProcessLog(tmp_path / "a.log", max_bytes=100)
    log.write("x" * 500)
    log.write("y")
    assert (tmp_path / "a.log.1").read_text() == "x" * 500 + "\n"
    assert (tmp_path / "a.log").read_text() == "y\n"


def test_a_failing_disk_is_counted_and_never_raised(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    log = ProcessLog(tmp_path / "file" / "a.log")
    log.write("lost\nlost too")
    assert log.lost_lines == 2


def test_each_process_has_its_place(tmp_path: Path) -> None:
    layout = FlightLayout(tmp_path)
    places = {
        "airspy_rx": "airspy_csdr_netcat_log/airspy_rx.log",
        "receiver": "channelizer_log/receiver.log",
        "detector_1": "detector_log/detector_1.log",
        "connection": "process_log/connection.log",
        "../../etc/x": "process_log/_.._etc_x.log",
    }
    assert {one: layout.process_log(one) for one in places} == {
        process: tmp_path / place for process, place in places.items()
    }
