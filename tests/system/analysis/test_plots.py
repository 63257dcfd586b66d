"""What plots cost a program that lacks Matplotlib."""

from pathlib import Path

from command_line import python


def test_without_matplotlib_the_remedy_is_said(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "from pathlib import Path\n"
        "from uavrt.analysis.report.plots import DetectionPlots\n"
        "from uavrt.core.errors import UsageError\n"
        "try:\n    DetectionPlots(Path(sys.argv[1]), [])\n"
        "except UsageError as error:\n    print(error)\n"
    )
    run = python("-c", code, tmp_path / "x", check=True, timeout=60)
    assert "uavrt[analysis]" in run.stdout
    assert not (tmp_path / "x").exists()
