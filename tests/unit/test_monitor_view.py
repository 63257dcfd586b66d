"""What the terminal view says of a tag."""

import io
from dataclasses import replace

from rich.console import Console

from uavrt.ipc.topics import decode_record, encode_record
from uavrt.messages import Pulse, SystemState, SystemStatus, Tag
from uavrt.monitor import MonitorView

PULSE = Pulse(
    tag_id=2,
    frequency_hz=148.7e6,
    start_time_ns=1_700_000_000_000_000_000,
    end_time_ns=1_700_000_000_020_000_000,
    snr_db=21.04,
    group_snr_db=21.0,
    score=2.0,
    group_index=1,
    group_sequence=1,
    noise_psd=1e-9,
    detection_status="confirmed",
    confirmed=True,
    rate=1,
    predicted_next_start_ns=None,
    predicted_next_end_ns=None,
)
TAG = Tag(
    tag_id=2, frequency_hz=148.7e6, pulse_width_s=0.02, pulse_intervals_s=(1.2,), name="lynx"
)


def shown(pulse: Pulse) -> str:
    """The view after a pulse that came as the supervisor sends it."""
    view = MonitorView()
    status = SystemStatus(
        time_ns=PULSE.start_time_ns,
        state=SystemState.DETECTING,
        flight_directory=None,
        center_frequency_hz=148.7e6,
        tags=(TAG,),
        processes=(),
    )
    view.take("status", status, 0.0)
    topic, record = decode_record(encode_record("pulse", pulse).rstrip(b"\n"))
    view.take(topic, record, 0.0)
    screen = io.StringIO()
    Console(width=160, file=screen).print(view.render(1.0))
    return screen.getvalue()


def test_a_pulse_that_may_be_of_another_tag_is_shown_with_both_numbers() -> None:
    assert "2 or 4 or 6 lynx" in shown(replace(PULSE, also_possible_tag_ids=(4, 6)))
    assert " or " not in shown(PULSE)


def test_the_snr_of_a_clipped_pulse_is_shown_as_a_lower_bound() -> None:
    assert "≥ 21.0 dB" in shown(replace(PULSE, clipped=True))
    assert "≥" not in shown(PULSE)
