"""Help lists antennas, methods and formats as the registries have them."""

import pytest
from command_line import Ran

from uavrt.analysis.export.written import EXPORT_FORMATS
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.bearing.estimate_bearing import ADDED_METHODS as BEARING_METHODS
from uavrt.localization.position.estimate_position import ADDED_METHODS as POSITION_METHODS


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("export", [*EXPORT_FORMATS, *PATTERNS]),
        ("localize", ["bayes", "mest_lenth", *POSITION_METHODS, *PATTERNS]),
        ("bearing", ["pattern_ml", "ls_db", *BEARING_METHODS]),
        ("report", [*PATTERNS]),
        ("batch", ["mest_lenth", *POSITION_METHODS]),
    ],
)
def test_help_lists_what_the_registries_have(
    command: str, names: list[str], ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    shown = ran(command, "--help").out
    assert "{" not in shown
    assert [name for name in names if name not in shown] == []
