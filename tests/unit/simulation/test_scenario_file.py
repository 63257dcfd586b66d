from pathlib import Path

import pytest

from uavrt.config.tags.tag_files import parse_tags
from uavrt.core.errors import ConfigError
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import (
    load_scenario,
    parse_scenario,
    scenario_toml,
    write_scenario,
)

TAG = """
[[tag]]
tag_id = 2
frequency_hz = 148.6e6
pulse_width_s = 0.02
pulse_intervals_s = [1.3]
"""


def test_the_demo_survives_a_file(tmp_path: Path) -> None:
    scenario = demo_scenario(75.5, seed=9)
    write_scenario(scenario, tmp_path / "demo.toml")
    assert load_scenario(tmp_path / "demo.toml") == scenario


def test_an_empty_file_is_a_world_without_tags() -> None:
    assert parse_scenario("") == Scenario()


def test_a_few_lines_make_a_scenario() -> None:
    scenario = parse_scenario('start_time = "2026-05-01T06:00:00Z"\n' + TAG)
    assert scenario.start_time_ns == 1_777_615_200 * 10**9
    assert scenario.tags[0].frequency_hz == 148.6e6
    assert scenario.center_frequency_hz == 148.6e6


def test_all_faults_are_listed_with_their_places() -> None:
    text = """
    duration_s = -1
    unknown = 3
    start_time = "yesterday"
    [antenna]
    pattern = "RA-99"
    """ + TAG.replace("0.02", "nan").replace("148.6e6", '"high"')
    with pytest.raises(ConfigError) as caught:
        parse_scenario(text, source="world.toml")
    message = str(caught.value)
    for place in (
        "world.toml has 6 faults",
        "duration_s:",
        "unknown:",
        "start_time:",
        "antenna.pattern:",
        "tag[1].frequency_hz:",
        "tag[1].pulse_width_s:",
        "docs/reference/scenario.md",
    ):
        assert place in message


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (TAG + TAG, "tag[2].tag_id: 2 is used"),
        (TAG.replace("1.3", "0.01"), "not longer than the pulse"),
        (TAG + "rate_switches_s = [5.0]", "two rates need two intervals"),
        (TAG.replace("1.3", "1.3, 2") + "rate_switches_s = [5.0, 4.0]", "must increase"),
        (
            TAG.replace("1.3", "1.3, 2") + "rate_switches_s = [5]\nrate_pattern = [1, 2]",
            "not both",
        ),
        (TAG.replace("1.3", "1.3, 2, 3"), "tag[1].pulse_intervals_s"),
        (TAG.replace("148.6e6", "148.6"), "tag[1].frequency_hz: Input should be greater"),
        ("[radio]\ncenter_frequency_hz = 148.6", "radio.center_frequency_hz"),
        ('[[interferer]]\nkind = "carrier"\nfrequency_hz = 148', "interferer[1].frequency_hz"),
        ('[[interferer]]\nkind = "carrier"', "a carrier needs a frequency"),
        ('[antenna]\npattern = "table"', "at least 2 values"),
        ("[antenna]\ntable_db = [0, 1]", "not used by the pattern"),
        ("[[flight.leg]]\nduration_s = 0", "flight.leg[1].duration_s"),
        ('start_time = "2026-05-01"\nstart_time_ns = 5', "given twice"),
        ("a = = 3", "not valid TOML"),
    ],
)
def test_a_fault_is_named(text: str, fault: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_scenario(text)
    assert fault in str(caught.value)


def test_a_missing_file_is_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="'demo' for the built-in world"):
        load_scenario(tmp_path / "none.toml")


def test_a_file_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_scenario(path)


def test_the_reference_names_every_key() -> None:
    page = (Path(__file__).parents[3] / "docs/reference/scenario.md").read_text()
    keys = {
        line.split(" = ")[0]
        for line in scenario_toml(demo_scenario()).splitlines()
        if " = " in line
    }
    assert not {key for key in keys if f"`{key}`" not in page}


CODED = """
[[tag]]
tag_id = 12
frequency_hz = 166370000
pulse_width_s = 0.0025
pulse_intervals_s = [2.3]
gaps_s = [0.022, 0.0488, 0.0366]
"""


def test_a_coded_tag_is_listed_as_a_tag_file_lists_it(tmp_path: Path) -> None:
    codes = "id,freq,g1,g2,g3,bi\n12,166.37,22,48.8,36.6,2.3\n"
    assert parse_scenario(CODED).tags == parse_tags(codes.encode(), name="codes.csv")
    told = CODED + "k = 3\ninterval_uncertainty_s = 0.0\n"
    (tag,) = parse_scenario(told).tags
    assert (tag.k, tag.interval_uncertainty_s) == (3, 0.0)
    (beeping,) = parse_scenario(TAG).tags
    assert (beeping.k, beeping.interval_uncertainty_s) == (3, 0.0)
    write_scenario(parse_scenario(CODED), tmp_path / "again.toml")
    assert load_scenario(tmp_path / "again.toml") == parse_scenario(CODED)


@pytest.mark.parametrize(
    ("gaps", "fault"),
    [
        ("[0.004, 0.0488]", "they would overlap"),
        ("[1.2, 0.0488]", "at most 1000 ms"),
        ("[0.03, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03]", "a burst can have 1 to 7 gaps"),
    ],
)
def test_codes_that_no_tag_file_may_list_are_refused_beforehand(gaps: str, fault: str) -> None:
    text = CODED.replace("[0.022, 0.0488, 0.0366]", gaps)
    with pytest.raises(ConfigError) as caught:
        parse_scenario(text)
    assert "tag[1]: not valid in a tag file" in str(caught.value)
    assert fault in str(caught.value)
    (neighbour,) = parse_scenario(text + "listed = false\n").tag
    assert neighbour.gaps_s
