"""What the terminal view says of a tag."""

import io
from dataclasses import replace

import made
from rich.console import Console

from uavrt.cli.system.monitor_view import MonitorView
from uavrt.core.messages import Pulse, SystemStatus
from uavrt.drone.ipc.topics import decode_record, encode_record
from uavrt.flight.reading.outline import ReceivedTag

PULSE = made.pulse(
    1_700_000_000_000_000_000,
    frequency_hz=148.7e6,
    snr_db=21.04,
    group_snr_db=21.0,
    noise_psd=1e-9,
)
TAG = made.tag(2, 148.7e6, 1.2, name="lynx")


STATUS = made.system_status(PULSE.start_time_ns, center_frequency_hz=148.7e6, tags=(TAG,))


def view_of(status: SystemStatus = STATUS) -> MonitorView:
    view = MonitorView()
    view.add("status", status, 0.0)
    return view


def screen_of(view: MonitorView, time_s: float = 1.0) -> str:
    screen = io.StringIO()
    Console(width=160, file=screen).print(view.render(time_s))
    return screen.getvalue()


def shown(pulse: Pulse) -> str:
    """The view after a pulse that came as the supervisor sends it."""
    view = view_of()
    topic, record = decode_record(encode_record("pulse", pulse).rstrip(b"\n"))
    view.add(topic, record, 0.0)
    return screen_of(view)


def test_a_pulse_that_may_be_of_another_tag_is_shown_with_both_numbers() -> None:
    assert "2 or 4 or 6 lynx" in shown(replace(PULSE, also_possible_tag_ids=(4, 6)))
    assert " or " not in shown(PULSE)


def test_the_snr_of_a_clipped_pulse_is_shown_as_a_lower_bound() -> None:
    assert "≥ 21.0 dB" in shown(replace(PULSE, clipped=True))
    assert "≥" not in shown(PULSE)


def test_a_radio_that_was_absent_before_the_monitor_began_is_shown_with_the_reason() -> None:
    reason = "receiver: radio absent (reason: Plug the radio in)"
    process = made.process_status("receiver", status="radio absent", ok=False, reason=reason)
    assert reason in screen_of(view_of(replace(STATUS, processes=(process,))))


def test_what_was_recorded_before_the_monitor_began_counts_and_nothing_counts_twice() -> None:
    view = MonitorView()
    view.add("status", replace(STATUS, time_ns=PULSE.start_time_ns + 90_000_000_000), 100.0)
    heard = ReceivedTag(pulses=30, first_ns=1, last_ns=PULSE.start_time_ns)
    view.take_recorded({2: heard}, 100.0)
    view.add("pulse", PULSE, 100.0)  # recorded already, and still on its way here
    assert view.heard[2].pulses == 30
    view.add("pulse", replace(PULSE, start_time_ns=PULSE.start_time_ns + 1), 100.0)
    assert view.heard[2].pulses == 31

    view = view_of()
    view.take_recorded({2: heard}, 100.0)
    assert "90 s ago" in screen_of(view, 190.0)


def test_an_occupied_frequency_is_shown_with_the_weakest_tag_that_would_be_found() -> None:
    view = view_of()
    report = replace(
        made.search_report(2, PULSE.start_time_ns), usable_share=0.43, weakest_enr_db=9.6
    )
    view.add("search_report", report, 0.0)
    assert "43 %, from 10 dB" in screen_of(view)


def test_another_flight_counts_from_its_own_beginning() -> None:
    status = replace(STATUS, flight_directory="/flights/1")
    view = view_of(status)
    view.add("pulse", PULSE, 0.0)
    for directory, pulses in (("/flights/1", 1), (None, 1), ("/flights/2", 0)):
        view.add("status", replace(status, flight_directory=directory), 1.0)
        assert sum(one.pulses for one in view.heard.values()) == pulses, directory
