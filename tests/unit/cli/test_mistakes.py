"""Whatever a command is given: one clear line with the remedy, status 2, no traceback.

In this process, for speed; `test_wrong_inputs` does the same with real ones.
"""

from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran

from uavrt.flight.logs.pulse_files import PulseWriter
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.simulated_recording import simulate_to_directory

TAG = "2, 148710000, 1254, 20, 60, 10, 3, 0.005\n"
RADIO = "--sample-rate 250e3 --center-frequency 148.7e6"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    noise = 0.01 * rng.standard_normal(2 * 25_000).astype("<f4")
    (tmp_path / "a.cf32").write_bytes(noise.tobytes())
    (tmp_path / "junk").write_bytes(rng.bytes(3000))
    (tmp_path / "junk.toml").write_bytes(rng.bytes(3000))
    for name in ("empty", "empty.csv", "empty.jsonl", "empty.geojson", "empty.ulg"):
        (tmp_path / name).touch()
    (tmp_path / "broken.geojson").write_text('{"type": \n')
    (tmp_path / "broken.ulg").write_bytes(b"ULog" + rng.bytes(200))
    (tmp_path / "junk.sigmf-meta").write_bytes(rng.bytes(300))
    (tmp_path / "junk.sigmf-data").touch()
    (tmp_path / "tags.txt").write_text(TAG)
    with (tmp_path / "pulses.jsonl").open("w") as stream:
        PulseWriter(stream, "jsonl").write(made.pulse(1_700_000_001_000_000_000))
    (tmp_path / "place").mkdir()
    simulate_to_directory(
        demo_scenario(), tmp_path / "world", duration_s=0.1, sample_rate_hz=250e3
    )
    return tmp_path


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("tags measure nowhere.cf32", "Check the path"),
        (f"tags measure a.cf32 {RADIO} --id -3", "--id"),
        (f"tags measure a.cf32 {RADIO} --id 5000000000", "--id"),
        (f"tags measure a.cf32 {RADIO} --frequency nan", "--frequency"),
        (f"tags measure a.cf32 {RADIO} --window nan", "--window"),
        (f"tags measure a.cf32 {RADIO} -o no/such.toml", "no"),
        (f"tags measure a.cf32 {RADIO} -o place", "directory"),
        (f"tags measure a.cf32 {RADIO} -o a.cf32 --overwrite", "another name"),
        (f"tags measure a.cf32 {RADIO}", "at least ten pulses"),
        (
            "tags measure junk --format cf32 --sample-rate 250e3 --center-frequency 1e8",
            "too large",
        ),
        ("tags convert tags.txt place --overwrite", "directory"),
        ("tags convert tags.txt no/such.toml", "Create it"),
        ("attach pulses.jsonl junk -o pulses.jsonl", "another name"),
        ("attach pulses.jsonl junk -o junk", "another name"),
        ("attach pulses.jsonl junk -o place", "directory"),
        ("attach pulses.jsonl junk -o x.csv --clock-offset nan", "--clock-offset"),
        ("attach pulses.jsonl junk -o x.csv --clock-offset 1e30", "--clock-offset"),
        ("attach pulses.jsonl junk -o x.csv --yaw-offset nan", "--yaw-offset"),
        ("report pulses.jsonl --no-pdf -o tags.txt", "cannot write"),
        ("export pulses.jsonl -o tags.txt", "cannot write"),
        ("localize pulses.jsonl", "autopilot connected"),
        ("localize", "Name a flight"),
        ("export empty", "nothing was exported"),
        ("bearing junk", "Choose from"),
        ("localize world", "uavrt detect world/simulation.sigmf-meta --tags world/tags.toml"),
        ("bearing world", "uavrt detect world/simulation.sigmf-meta --tags world/tags.toml"),
        ("localize world/TagInfo.txt", "is a list of tags"),
        ("simulate demo -o another --duration 1e9", "Record less"),
        ("report empty.csv", "empty.csv is empty"),
        ("localize empty.csv empty.jsonl", "empty.csv is empty"),
        ("bearing empty.jsonl", "empty.jsonl is empty"),
        ("attach empty.jsonl junk -o x.csv", "empty.jsonl is empty"),
        ("attach pulses.jsonl empty.ulg -o x.csv", "empty.ulg is empty"),
        ("attach pulses.jsonl broken.ulg -o x.csv", "Copy it from the autopilot again"),
        ("report pulses.jsonl --no-html --no-pdf", "Leave one of them out"),
        ("report pulses.jsonl --map junk", "Give an MBTiles or PMTiles"),
        ("coverage nowhere --tag-power -25", "nowhere does not exist"),
        ("coverage junk --tag-power -25", "junk is not text"),
        ("coverage empty.geojson --tag-power -25", "empty.geojson is empty"),
        ("coverage broken.geojson --tag-power -25", "the JSON is invalid from line 2 on"),
        ("fly survey --area junk --height 60", "junk is not text"),
        ("fly survey --area nowhere --height 60", "nowhere does not exist"),
        ("fly goto 500 8", "500 is not a latitude"),
        ("fly goto 50 188", "188 is not a longitude"),
        ("detect junk.sigmf-meta --tags tags.txt", "Copy it again"),
        (f"detect a.cf32 {RADIO} --tags tags.txt -o no/out.csv", "Make the directory"),
        ("update nowhere.tar --check", "no file nowhere.tar"),
        ("report", "FLIGHT is missing: uavrt report FLIGHT"),
        ("tags check", "FILE is missing: uavrt tags check FILE"),
        ("coverage place", "--tag-power is missing"),
        ("doctor --mavlink foo", "foo"),
        ("doctor --port TELEM1", "--autopilot"),
        ("doctor --flight --mavlink udpin://127.0.0.1:1", "--flight"),
        ("simulate nowhere -o world", "No such file"),
        ("simulate junk.toml -o world", "UTF-8"),
        ("simulate demo -o tags.txt --duration 1", "Choose a writable directory"),
        ("fetch ../../etc/passwd", ".."),
        ("fetch --timeout nan", "--timeout"),
        ("fetch --signing-key nowhere", "No such file"),
        ("fetch --signing-key junk", "64 hexadecimal"),
        ("ground --command-key nowhere", "No such file"),
        ("ground --port 99999", "--port"),
        ("ground --headless --mavlink serial:///dev/nosuch:57600 -o another", "nosuch"),
        ("ground --headless --vehicle 3 --dem hills", "--vehicle, --dem"),
        ("ground --headless --archive searched", "--archive"),
        ("ground --no-browser --port 0 -o flights --archive flights", "recordings.parquet"),
        ("report pulses.jsonl -o r.pdf", "Give the directory"),
        ("ground --vehicle 300", '"300" for --vehicle'),
        ("ground --no-browser --port 0 -o flights --certificate nowhere", "nowhere"),
        ("ground --no-browser --port 0 -o flights --certificate junk --key junk", "PEM"),
        ("ground --no-browser --port 0 -o flights --key junk", "--certificate"),
        ("run --ground --ground-port -1", "--ground-port"),
        ("demo --port 99999", "--port"),
        ("demo --seed -1", "--seed"),
        ("demo --headless --picture no/such.svg", "no"),
        ("service install --user pi --root tags.txt", "--root"),
        ("experiment detection --seed -1", "--seed"),
        ("experiment detection --output-dir tags.txt --no-plots", "--output-dir"),
        ("experiment localization --output no/such.csv", "no"),
        ("experiment rotation --sample-rate -1", "--sample-rate"),
        ("experiment rotation -o place", "directory"),
        ("experiment capacity --counts 0", "--counts"),
        ("experiment capacity --plot picture.doc", ".png"),
        ("experiment packets --flight-dir tags.txt", "--flight-dir"),
        ("experiment recovery --flight-dir tags.txt", "--flight-dir"),
        ("channelize udp://192.0.2.1:10000", "of this computer"),
        (f"channelize a.cf32 {RADIO} --speed nan", "--speed"),
        (f"channelize a.cf32 {RADIO} --speed -1", "--speed"),
        (
            f"channelize a.cf32 {RADIO} --mode default --host no.invalid --channels 1",
            "Check the name",
        ),
    ],
)
def test_a_mistake_is_told_with_what_to_do(
    folder: Path, ran: Ran, line: str, says: str
) -> None:
    kept = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    said = ran(*line.split(), ends=2)
    assert says in said.err + said.out
    assert "Traceback" not in said.err
    assert "Errno" not in said.err
    assert {path: path.read_bytes() for path in kept} == kept
    assert not (folder / "another").exists()


def test_a_simulated_recording_names_the_tag_list_that_holds_all_of_it(
    folder: Path, ran: Ran
) -> None:
    line = "simulate demo -o one --duration 0.1 --sample-rate 250e3"
    said = ran(*line.split())
    assert "tags in tags.toml" in said.out
    less = "TagInfo.txt cannot hold a second interval or a code: of tag 4 it has less"
    assert less in said.words


def test_each_command_says_what_it_does_and_shows_how(
    ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    from uavrt.cli.app import COMMANDS

    monkeypatch.setenv("COLUMNS", "120")
    for name in COMMANDS:
        said = ran(*name.split(), "--help").out
        # Commands with commands of their own show examples with these.
        assert "Examples:" in said or "COMMAND" in said, name
        assert "--empty-" not in said
        assert "default: False" not in said
        assert "default: ()" not in said


def test_every_example_is_a_command_with_options_that_exist(
    ran: Ran,
) -> None:
    from uavrt.cli.examples import EXAMPLES

    for name, lines in EXAMPLES.items():
        known = ran(*name.split(), "--help").out
        for line in lines:
            assert f"uavrt {name}" in line or line.endswith("|")
            words = line.partition("#")[0].rpartition(f"uavrt {name}")[2].split()
            for word in words if not line.endswith("|") else ():
                assert not word.startswith("-") or word == "-" or word in known, (name, word)
