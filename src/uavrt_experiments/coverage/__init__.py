"""What silence and weak pulses say over hills (`uavrt coverage`, `uavrt localize --dem`)."""
