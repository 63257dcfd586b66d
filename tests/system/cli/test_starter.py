"""The starter in the desktop's menu: written, valid, removed."""

import configparser
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from uavrt.core.errors import UsageError
from uavrt.drone.computer.starter import ENTRY, ICON, ICON_TEXT, install_starter

UAVRT = Path(sys.executable).with_name("uavrt")


def starter(*words: str, place: Path) -> "subprocess.CompletedProcess[str]":
    command = [str(UAVRT), "starter", *words, "--directory", str(place)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def started(place: Path) -> list[str]:
    """What a desktop would start, read as the specification says."""
    entry = configparser.ConfigParser(interpolation=None)
    entry.read(place / ENTRY)
    value = entry["Desktop Entry"]["Exec"].replace("\\\\", "\\")
    words = re.findall(r'"(?:[^"\\]|\\.)*"|\S+', value)
    return [re.sub(r"\\(.)", r"\1", word.strip('"')).replace("%%", "%") for word in words]


def test_the_starter_starts_this_ground_station_and_goes_again(tmp_path: Path) -> None:
    for _ in range(2):
        assert starter("install", place=tmp_path).returncode == 0
    assert started(tmp_path) == [str(UAVRT), "ground"]
    assert (tmp_path / ICON).read_text() == ICON_TEXT
    if shutil.which("desktop-file-validate"):
        subprocess.run(["desktop-file-validate", tmp_path / ENTRY], check=True)
    assert starter("remove", place=tmp_path).stdout.count("removed") == 2
    assert starter("remove", place=tmp_path).stdout == "there is no starter\n"
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_program_in_an_odd_place_is_quoted(tmp_path: Path) -> None:
    program = tmp_path / 'my "own" $HOME\\100 %u `x`' / "uavrt"
    program.parent.mkdir()
    program.touch()
    install_starter(program, tmp_path)
    assert started(tmp_path) == [str(program), "ground"]


def test_what_cannot_be_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="Install uavrt"):
        install_starter(tmp_path / "nothing", tmp_path)
    (tmp_path / "applications").touch()
    refused = starter("install", place=tmp_path)
    assert refused.returncode == 2
    assert "another --directory" in refused.stderr
    assert "Traceback" not in refused.stderr
