import os
import signal
from pathlib import Path

from command_line import launched
from some import some

from uavrt.flight.database.writer_lock import WriterLock

HOLDER = """
import sys, time
from pathlib import Path
from uavrt.flight.database.writer_lock import WriterLock
lock = WriterLock()
print(lock.take(Path(sys.argv[1]), 0.0), flush=True)
time.sleep(60)
"""


def test_a_flight_has_one_writer_until_that_one_ends_however_it_ends(tmp_path: Path) -> None:
    flight = tmp_path / "flight"
    holder = launched("-c", HOLDER, flight)
    try:
        assert some(holder.stdout).readline() == "True\n"
        ours = WriterLock()
        assert not ours.take(flight, 0.1)
        os.kill(holder.pid, signal.SIGKILL)
        assert ours.take(flight, 10.0)
        assert list(flight.iterdir()) == []
        ours.release()
    finally:
        holder.kill()
        holder.communicate()


def test_a_place_that_cannot_be_made_has_no_lock(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert not WriterLock().take(tmp_path / "file" / "flight", 0.0)
