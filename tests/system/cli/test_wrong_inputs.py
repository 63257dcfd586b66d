"""What a user gets for a mistake: a clear error that names the remedy, and an exit code."""

import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import started, uavrt
from cyclopts import App, CycloptsError

from uavrt.cli.app import make_app


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "--mavlink", "bogus://x"], "bogus"),
        (["run", "--config", "none.toml"], "none.toml"),
        (["run", "--tags", "none.txt"], "none.txt"),
        (["run", "--flight-dir", "/proc/flights"], "--flight-dir"),
        (["ground", "--start"], "--tags"),
        (["ground", "--mavlink", "serial:///dev/no-such-port:57600"], "no-such-port"),
        (["ground", "-o", "/proc/ground"], "-o"),
        (["demo", "--duration", "10"], "40"),
        (["demo", "--flight-dir", "/proc/flights", "--headless"], "--flight-dir"),
        (["simulate", "demo", "-o", "world", "--duration", "nan"], "--duration"),
        (["experiment", "packets", "--model", "--loss", "3"], "--loss"),
        # A group of 2000 needed -30.0 dB, where the search for its level begins.
        (["range", "--tag-power=-20", "--pulses", "2000"], "--pulses"),
        (["range", "--tag-power=-20", "--antenna", "monopole"], "applies to --whole-flight"),
        (["range", "--tag-power=-20", "--tags=x", "--frequency=151e6"], "--tags has its own"),
        (["experiment", "resources", "--shapes", "--tags", "0"], "--tags"),
        (["experiment", "recovery", "--kills", "-1"], "--kills"),
        (["experiment", "localization", "--runs", "0"], "--runs"),
        (["experiment", "search", "--runs", "0"], "--runs"),
        (["experiment", "rotation", "--walls", "-1"], "--walls"),
        (["experiment", "detection", "--only", "E99"], "E99"),
    ],
)
def test_a_mistake_is_refused_with_its_remedy(
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    arguments: list[str],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert uavrt(*arguments) != 0
    said = "".join(capfd.readouterr())
    assert says in said
    assert "Traceback" not in said


def test_a_command_that_does_not_exist_ends_the_program_without_a_traceback() -> None:
    finished = started("no-such-command")
    assert finished.returncode != 0
    said = finished.stdout + finished.stderr
    assert "no-such-command" in said
    assert "Traceback" not in said


def numbers(app: App, path: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    """Every option of every command that takes a number."""
    for argument in app.assemble_argument_collection() if app.default_command else ():
        if argument.name.startswith("--") and re.search(r"\b(int|float)\b", str(argument.hint)):
            yield " ".join(path), argument.name
    for name in app:
        if not name.startswith("-"):
            yield from numbers(app[name], (*path, name))


NEEDED = {
    "detect": ["recording.sigmf"],
    "attach": ["pulses.csv", "track.ulg", "--output=posed.csv"],
    "bearing": ["pulses.csv"],
    "report": ["flight"],
    "season": ["flights"],
    "export": ["flight"],
    "fly": ["hold"],
    "range": ["--tag-power=-20"],
    "coverage": ["area.kml", "--tag-power=-20"],
    "integrate": ["flight"],
    "batch": ["archive", "--tags=tags.toml", "--output=searched"],
    "simulate": ["demo", "--output=world"],
    "tags measure": ["recording.sigmf"],
}
"""What these commands do not start without."""


def test_every_number_on_the_command_line_has_limits() -> None:
    app = make_app(added=True)
    asked = list(numbers(app))
    assert len(asked) > 50
    for command, option in asked:
        for value in ("nan", "1e999", str(-(10**12)), "many"):
            with pytest.raises(CycloptsError) as caught:
                app.parse_args(
                    [*command.split(), *NEEDED.get(command, []), f"{option}={value}"],
                    exit_on_error=False,
                    print_error=False,
                )
            assert option in str(caught.value), (command, option, value)


def test_a_port_in_use_is_named(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        finished = started("ground", "--mavlink", f"udpin://127.0.0.1:{port}", cwd=tmp_path)
    assert finished.returncode == 2
    assert str(port) in finished.stderr
    assert "Traceback" not in finished.stderr


def test_what_holds_no_bearings_is_refused_without_the_systems_own_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("picture.csv").write_bytes(b"\xff\xfe\x00\x9f")
    for name, says in (("nosuch", "No such file"), ("picture.csv", "not a known pulse log")):
        assert uavrt("localize", name) == 2
        said = capsys.readouterr().err
        assert says in said
        assert "Errno" not in said
    assert "bearings.csv" in said
