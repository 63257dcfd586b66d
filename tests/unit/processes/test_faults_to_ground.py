"""Why a process is not ok reaches ground stations that were away when it was reported."""

from typing import Any

import made
from until import until_async as until

from uavrt.messages import StatusText

Bay = Any  # tests/unit/processes/conftest.py
REASON = "Airspy: no radio is plugged in. Plug the radio in, or try another cable or port"
TEXT = f"receiver: radio absent (reason {REASON})"


async def test_a_station_that_appears_after_a_fault_reads_its_reason_and_reads_it_again(
    bay: Bay,
) -> None:
    fault = made.process_status("receiver", "radio absent", ok=False, reason=REASON)
    bearable = made.process_status("recorder", "ready")

    async with bay.running():
        both = made.system_status(bay.clock.now_ns(), processes=(fault, bearable))
        bay.deliver("system_status", both)
        async with bay.ground_station() as (_, events):

            def times() -> int:
                texts = [one for one in events if isinstance(one, StatusText)]
                return sum(one == StatusText(severity=4, text=TEXT) for one in texts)

            await until(times)
            first_ns = bay.clock.now_ns()
            await until(lambda: times() > 1)
            assert 28e9 < bay.clock.now_ns() - first_ns < 36e9
