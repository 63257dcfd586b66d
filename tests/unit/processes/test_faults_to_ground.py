"""Lasting faults reach ground stations that missed their first report, or a piece of it."""

from typing import Any

import made
from until import until_async as until

from uavrt.core.messages import StatusText
from uavrt.drone.card import NEW_CARD

Bay = Any  # tests/unit/processes/conftest.py
REASON = "Airspy: no radio is plugged in. Plug the radio in, or try another cable or port"
RADIO = StatusText(severity=4, text=f"receiver: radio absent (reason {REASON})")
CARD = StatusText(
    severity=3,
    text=f"Memory card: the file system is read-only and records nothing more. {NEW_CARD}",
)


async def test_a_station_that_appears_after_the_faults_reads_them_and_reads_them_again(
    bay: Bay,
) -> None:
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
