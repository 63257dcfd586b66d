"""What the drone tells of itself, over the real way: connection, autopilot, ground station."""

import asyncio
from typing import Any

import made
from until import until_async as until

from uavrt.core.commands import SystemState
from uavrt.core.messages import SearchReport, StatusText, SystemStatus
from uavrt.drone.card import NEW_CARD
from uavrt.ground.link.protocol import DetectorAlive, DroneHeartbeat
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import Frame

Bay = Any  # tests/unit/processes/conftest.py
TAGS = tuple(made.tag(number, 148.7e6 + 10_000.0 * number) for number in (2, 4))
LONG = "Detector 1 gave up on tag 4: " + "its channel has been overloaded " * 5


async def test_state_tags_searches_texts_and_load_reach_the_ground(bay: Bay) -> None:
    loads: list[dialect.OnboardComputerStatus] = []

    def take(frame: Frame) -> None:
        message = frame.message() if frame.component_id == 191 else None
        if isinstance(message, dialect.OnboardComputerStatus):
            loads.append(message)

    async with bay.running(), bay.ground_station(on_frame=take) as (_, events):

        def of(kind: type) -> list[Any]:
            return [event for event in events if isinstance(event, kind)]

        bay.deliver("system_status", status(bay.clock.now_ns()))
        bay.send_pulse(1)  # tag 2 is found
        bay.deliver("search_report", report(4, bay.clock.now_ns()))
        bay.deliver("search_report", report(4, bay.clock.now_ns()))  # too soon for another
        bay.deliver("status_text", StatusText(severity=4, text=LONG))
        warning = StatusText(severity=4, text=LONG)
        await until(lambda: of(SearchReport) and warning in of(StatusText) and loads)
        await until(lambda: {alive.tag_id for alive in of(DetectorAlive)} == {2, 4})
        (search,) = of(SearchReport)
        assert search.tag_id == 4
        assert search.noise_psd == 2.0**-40
        heard = StatusText(severity=6, text="Tag 2 detected: 20.0 dB")
        await until(lambda: heard in of(StatusText))
        await until(lambda: of(DroneHeartbeat)[-1].state is SystemState.DETECTING)
    assert loads[0].ram_total > loads[0].ram_usage > 0
    assert loads[0].storage_total[0] > loads[0].storage_usage[0] >= 0
    assert loads[0].storage_total[0] != 0xFFFFFFFF


def status(time_ns: int) -> SystemStatus:
    return made.system_status(time_ns, center_frequency_hz=148.7e6, tags=TAGS)


def report(tag_id: int, time_ns: int) -> SearchReport:
    return made.search_report(tag_id, time_ns, frequency_hz=148.74e6, noise_psd=2.0**-40)


async def test_a_changed_state_is_sent_at_once_and_not_a_second_later(bay: Bay) -> None:
    async with bay.running(), bay.ground_station() as (_, events):
        loop = asyncio.get_running_loop()

        def last() -> SystemState | None:
            beats = [one for one in events if isinstance(one, DroneHeartbeat)]
            return beats[-1].state if beats else None

        idle = made.system_status(bay.clock.now_ns(), state=SystemState.IDLE)
        bay.deliver("system_status", idle)
        await until(lambda: last() is SystemState.IDLE)
        for number in range(10):
            state = SystemState.HAS_TAGS if number % 2 else SystemState.DETECTING
            await asyncio.sleep(0.31)
            changed_s = loop.time()
            now_ns = bay.clock.now_ns()
            bay.deliver("system_status", made.system_status(now_ns, state=state, tags=TAGS))
            await until(lambda state=state: last() is state)  # type: ignore[misc]
            assert loop.time() - changed_s < 0.3


REASON = "Airspy: no radio is plugged in. Plug the radio in, or try another cable or port"
RADIO = StatusText(severity=4, text=f"receiver: radio absent (reason {REASON})")
CARD = StatusText(
    severity=3,
    text=f"Memory card: the file system is read-only and records nothing more. {NEW_CARD}",
)


async def test_a_station_that_appears_after_faults_reads_them_repeatedly(bay: Bay) -> None:
    fault = made.process_status("receiver", "radio absent", ok=False, reason=REASON)
    bearable = made.process_status("recorder", "ready")

    async with bay.running():
        now_ns = bay.clock.now_ns()
        both = made.system_status(now_ns, processes=(fault, bearable), faults=(CARD,))
        bay.deliver("system_status", both)
        async with bay.ground_station() as (_, events):

            def times() -> int:
                return min(
                    sum(bool(event == text) for event in events) for text in (RADIO, CARD)
                )

            await until(times)
            first_ns = bay.clock.now_ns()
            await until(lambda: times() > 1)
            assert 28e9 < bay.clock.now_ns() - first_ns < 36e9
