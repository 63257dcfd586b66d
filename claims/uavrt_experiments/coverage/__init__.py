"""Tests of coverage maps, and of positions from weak pulses over hills (`uavrt coverage`,
`localize --dem`).
"""
