"""The screening of constants changes them in processes of their own."""

from uavrt_experiments.constants.report import table
from uavrt_experiments.constants.screening import chosen, screen


def test_the_screening_notices_a_constant_that_matters() -> None:
    """A narrower lobe makes bearings from few pulses ambiguous."""
    names = ["PATTERN.lobe_deg", "TURNS.height_error_m"]
    climb, lobe = screen(chosen(names, singly=True), 150, 1, judges=("turn of 8",))
    assert lobe.verdict == "matters"
    assert any(one.quantity == "ambiguous" and one.clear for one in lobe.effects)
    assert climb.verdict == "not screened"
    shown = table([lobe, climb])
    assert "| `PATTERN.lobe_deg` | 1 | matters | × 0.7: turn of 8 pulses" in shown
