"""The page on the drone's own computer: its copies lie beside the drone's flights."""

import asyncio
from pathlib import Path

import made
import pytest

from uavrt.config.settings import RecordingSettings
from uavrt.core.clock import Clock, boot_id
from uavrt.core.commands import SystemState
from uavrt.drone.supervisor.mission.saved_state import LOCK_NAME, SavedState, StateStore
from uavrt.drone.supervisor.mission.storage.disk_guard import DiskGuard
from uavrt.drone.supervisor.mission.storage.flight_removal import removable
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flights_in_order, note_flight
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.ground.session import GroundSession
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored_flights import FlightLibrary

LOOPBACK = "udpout://127.0.0.1:14560"


def fly(directory: Path, stamp: str) -> Path:
    """The drone side begins a flight there, and keeps its state as the supervisor does."""
    flight = directory / f"flight_log_{stamp}"
    info = made.flight_info(flight, start_time_ns=300 * 10**9)
    FlightRecorder.open(info).close()
    note_flight(flight)
    (directory / LOCK_NAME).touch()
    StateStore(directory).keep(
        SavedState(
            boot_id=boot_id(),
            clock_offset_ns=0,
            state=SystemState.DETECTING,
            tags=(),
            flight=info,
        )
    )
    return flight


def receive(directory: Path, address: str = LOOPBACK, vehicle: int | None = None) -> Path:
    """A page in that directory hears of the flight, and records what it receives."""

    async def begin() -> str:
        store = GroundStore(directory, vehicle)
        store.set_settings(store.settings.changed({"address": address}))
        session = GroundSession(store, Clock.start())
        session.vehicle.begin_flight()
        session.vehicle.flight.keeper.close()
        assert session.vehicle.flight.keeper.flight_id is not None
        return session.vehicle.flight.keeper.flight_id

    return directory / asyncio.run(begin())


def short_of_room(directory: Path, keep: int = 1) -> list[str]:
    """The disk guard removes all that it may; what is left of flights, in their order."""
    settings = RecordingSettings(
        minimum_free_mb=1e12, remove_oldest_flights=True, keep_newest_flights=keep
    )
    DiskGuard(directory, settings).check()
    return [flight.name for flight in flights_in_order(directory)]


def test_a_star_on_the_pages_copy_keeps_the_drones_own_flight(tmp_path: Path) -> None:
    flights = [fly(tmp_path, "2026-05-01_08-00-00")]
    copies = [receive(tmp_path)]
    flights.append(fly(tmp_path, "1970-01-01_00-05-00"))
    copies.append(receive(tmp_path))
    assert [copy.name for copy in copies] == [f"{flight.name}_ground" for flight in flights]
    library = FlightLibrary(tmp_path)
    library.star(copies[0].name, True)
    assert {one.flight_id for one in library.summaries() if one.starred} == {
        flights[0].name,
        copies[0].name,
    }
    assert removable(flights_in_order(tmp_path)) == []
    assert len(short_of_room(tmp_path)) == 4
    library.star(flights[0].name, False)  # the star of either is that of both
    assert not FlightLayout(copies[0]).star.exists()
    assert short_of_room(tmp_path) == [flights[1].name, copies[1].name]


def test_copies_go_with_their_flights_the_oldest_first(tmp_path: Path) -> None:
    """A flight and its copies are one of the newest that are kept, whatever the clock says."""
    stamps = ("2026-05-01_08-00-00", "1970-01-01_00-05-00", "1970-01-01_00-04-00")
    made = []
    for stamp in stamps:
        made += [fly(tmp_path, stamp), receive(tmp_path)]
    names = [flight.name for flight in made]
    again = receive(tmp_path)  # the page was restarted and has lost its state
    assert again.name == f"{names[4]}_ground_2"
    assert [flight.name for flight in flights_in_order(tmp_path)] == [*names, again.name]
    assert removable(flights_in_order(tmp_path)) == made[:4]
    assert short_of_room(tmp_path, keep=2) == [*names[2:], again.name]
    listed = [one.flight_id for one in FlightLibrary(tmp_path).summaries()]
    assert set(listed[:3]) == {*names[4:], again.name}


@pytest.mark.parametrize(
    ("address", "vehicle"), [("udpin://0.0.0.0:14550", None), (LOOPBACK, 7)]
)
def test_what_may_come_from_another_drone_is_no_copy_and_the_newest(
    tmp_path: Path, address: str, vehicle: int | None
) -> None:
    own = fly(tmp_path, "2026-05-01_08-00-00")
    other = receive(tmp_path, address, vehicle)
    assert not other.name.endswith("_ground")
    assert flights_in_order(tmp_path) == [own, other]


def test_elsewhere_a_ground_stations_flights_are_named_by_its_own_clock(tmp_path: Path) -> None:
    flight = receive(tmp_path)
    assert flight.name.startswith("flight_log_20")
    assert not flight.name.endswith("_ground")
    assert not (tmp_path / "flights_in_order.txt").exists()
