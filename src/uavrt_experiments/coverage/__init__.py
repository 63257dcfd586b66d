"""Reliability of silence and weak pulses over hills (`uavrt coverage`, `localize --dem`)."""
