import os
import time
from pathlib import Path

from forked import forked

from uavrt.flight.database.writer_lock import WriterLock


def hold(flight: Path, told: int) -> None:
    lock = WriterLock()
    os.write(told, b"taken" if lock.take(flight, 0.0) else b"refused")
    time.sleep(60.0)


def test_a_flight_has_one_writer_until_that_one_ends_however_it_ends(tmp_path: Path) -> None:
    flight = tmp_path / "flight"
    reading, told = os.pipe()
    holder = forked(hold, flight, told)
    assert os.read(reading, 9) == b"taken"
    ours = WriterLock()
    assert not ours.take(flight, 0.1)
    holder.kill()
    assert ours.take(flight, 10.0)
    assert list(flight.iterdir()) == []
    ours.release()
    for end in (reading, told):
        os.close(end)


def test_a_place_that_cannot_be_made_has_no_lock(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert not WriterLock().take(tmp_path / "file" / "flight", 0.0)
