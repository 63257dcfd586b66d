"""Help lists antennas, methods and formats as the registries have them."""

import sys

import pytest

from uavrt.analysis.export.written import EXPORT_FORMATS
from uavrt.cli.app import run
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.bearing.estimate_bearing import ADDED_METHODS as BEARING_METHODS
from uavrt.localization.position.estimate_position import ADDED_METHODS as POSITION_METHODS


def help_of(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> str:
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.setattr(sys, "argv", ["uavrt", command, "--help"])
    with pytest.raises(SystemExit):
        run()
    return capsys.readouterr().out


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
    command: str,
    names: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown = help_of(command, capsys, monkeypatch)
    assert "{" not in shown
    assert [name for name in names if name not in shown] == []
