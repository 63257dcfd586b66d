"""What the headings and heights of a flight are trusted to, in every command alike."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from depth import share

from uavrt.cli.options.placing_options import Placing
from uavrt.cli.results.export import export
from uavrt.cli.results.localize import localize
from uavrt.cli.results.report import report

WriteFlight = Callable[..., Path]
PRIORS: dict[str, dict[str, Any]] = {
    "RA-23K": {"heading_error": 0.0},
    "monopole": {"height_error": 40.0},
}


@pytest.mark.parametrize("antenna", share([*PRIORS], 2))
def test_report_and_export_trust_the_flight_as_localize_does(
    antenna: str, write_flight: WriteFlight, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight, priors = write_flight(tags=2, heard=1), PRIORS[antenna]
    localize(flight, place=Placing(antenna=antenna), as_json=True)
    (usual,) = json.loads(capsys.readouterr().out)
    localize(flight, place=Placing(antenna=antenna, **priors), as_json=True)
    (told,) = json.loads(capsys.readouterr().out)
    assert told["radius95_m"] != pytest.approx(usual["radius95_m"], abs=0.5)

    export(flight, place=Placing(antenna=antenna, **priors), formats=["csv"], output=tmp_path)
    with (tmp_path / "fixes.csv").open(encoding="utf-8") as file:
        fix = next(csv.DictReader(file))
    assert float(fix["radius95_m"]) == pytest.approx(told["radius95_m"], abs=0.01)

    report(flight, place=Placing(antenna=antenna, **priors), pdf=False, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert f"{told['radius95_m']:.0f} m (95 %)" in page
