"""The maker of pulses under its older name."""

from made import pulse as pulse_at

__all__ = ["pulse_at"]
