"""A pulse for tests that care about some of its numbers only."""

from typing import Any

from uavrt.messages import Pulse


def pulse_at(start_time_ns: int, **numbers: Any) -> Pulse:
    """A confirmed pulse of 20 ms, of tag 2 and 20 dB unless told otherwise."""
    snr_db = numbers.get("snr_db", 20.0)
    usual: dict[str, Any] = {
        "tag_id": 2,
        "frequency_hz": 148.71e6,
        "end_time_ns": start_time_ns + 20_000_000,
        "snr_db": snr_db,
        "group_snr_db": snr_db,
        "score": 2.0,
        "group_index": 1,
        "group_sequence": 1,
        "noise_psd": 1e-12,
        "detection_status": "confirmed",
        "confirmed": True,
        "rate": 1,
        "predicted_next_start_ns": None,
        "predicted_next_end_ns": None,
    }
    return Pulse(start_time_ns=start_time_ns, **(usual | numbers))
