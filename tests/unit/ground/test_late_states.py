"""States of the drone that arrive after the acknowledgement of a start."""

from pathlib import Path

from uavrt.core.clock import Clock
from uavrt.core.messages import SystemState
from uavrt.ground.link.protocol import DroneHeartbeat
from uavrt.ground.session import GroundSession
from uavrt.ground.store.ground_settings import GroundStore


def hear(session: GroundSession, *states: SystemState) -> None:
    for state in states:
        session.reception.receive_event(DroneHeartbeat(state=state, cpu_temperature_c=None))


async def test_states_of_before_a_start_end_no_flight(tmp_path: Path) -> None:
    session = GroundSession(GroundStore(tmp_path), Clock.start())
    session.vehicle.begin_flight()
    begun = session.vehicle.flight.keeper.flight_id
    hear(session, SystemState.IDLE, SystemState.RECEIVING_TAGS, SystemState.HAS_TAGS)
    assert not session.vehicle.flight.keeper.ended
    hear(session, SystemState.DETECTING)
    assert session.vehicle.flight.keeper.flight_id == begun
    hear(session, SystemState.HAS_TAGS)
    assert session.vehicle.flight.keeper.ended


async def test_a_resumed_flight_ends_by_the_first_state_of_an_idle_drone(
    tmp_path: Path,
) -> None:
    GroundSession(GroundStore(tmp_path), Clock.start()).vehicle.begin_flight()
    session = GroundSession(GroundStore(tmp_path), Clock.start())
    await session.vehicle.resume(session.library)
    assert not session.vehicle.flight.keeper.ended
    hear(session, SystemState.IDLE)
    assert session.vehicle.flight.keeper.ended
