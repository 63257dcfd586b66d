"""Settings: defaults, faults in plain words, and what a process pays for them."""

import json
from pathlib import Path

import pytest

from uavrt.config.guidance_rules import PLANNER_GROUP, PLANNER_NAMES
from uavrt.config.loader import (
    default_settings_text,
    load_settings,
    parse_settings,
    settings_schema,
    write_default_settings,
)
from uavrt.config.settings import AntennaSettings, RadioSettings, Settings
from uavrt.core.errors import ConfigError
from uavrt.planning.planners.registry import PLANNERS


def test_an_empty_file_gives_the_defaults() -> None:
    assert parse_settings(b"", name="uavrt.toml") == Settings()


def test_the_default_file_says_every_setting_and_gives_the_defaults(tmp_path: Path) -> None:
    write_default_settings(tmp_path / "uavrt.toml")
    assert load_settings(tmp_path / "uavrt.toml") == Settings()
    text = default_settings_text()
    schema = settings_schema()
    for table in schema["$defs"].values():
        for key, entry in table["properties"].items():
            assert f"\n{key} = " in text or f"\n# {key} =" in text, key
            assert entry.get("description"), f"{key} needs a comment in settings.py"
    assert max(len(line) for line in text.splitlines()) <= 96


def test_the_default_file_never_overwrites(tmp_path: Path) -> None:
    path = tmp_path / "uavrt.toml"
    path.write_text("[radio]\ngain = 3\n")
    with pytest.raises(ConfigError, match="exists already"):
        write_default_settings(path)
    assert load_settings(path).radio.gain == 3


def test_what_is_written_is_read_and_the_rest_has_defaults() -> None:
    settings = parse_settings(
        b'[radio]\nkind = "rtlsdr"\nsample_rate_hz = 2_400_000\nprogram = ["a", "b"]\n'
        b"[antenna]\nyaw_offset_deg = 90\n",
        name="uavrt.toml",
    )
    assert settings.radio == RadioSettings(
        kind="rtlsdr", sample_rate_hz=2.4e6, program=("a", "b")
    )
    assert settings.antenna == AntennaSettings(yaw_offset_deg=90.0)


def test_all_faults_are_told_at_once_each_with_its_line() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_settings(
            b"typo = 1\n"
            b"[radio]\n"
            b"gian = 2\n"
            b'sample_rate_hz = "3e6"\n'
            b'kind = "airspyy"\n'
            b"bias_tee = 1\n"
            b"[antenna]\n"
            b"pose_wait_s = -1\n"
            b"yaw_offset_deg = nan\n"
            b"[mavlink]\n"
            b"tunnel_gap_s = 0.001\n"
            b"component_id = 3.5\n"
            b"[[detection]]\n",
            name="uavrt.toml",
        )
    lines = caught.value.message.splitlines()
    assert lines[0] == "uavrt.toml has 10 faults:"
    assert [line.strip() for line in lines[1:]] == [
        "line 1: typo is unknown; known are " + ", ".join(settings_schema()["properties"]),
        "line 3: [radio] gian is unknown; did you mean gain?",
        'line 4: [radio] sample_rate_hz is "3e6", but must be a number without quotes',
        "line 5: [radio] kind is \"airspyy\", but must be 'airspy', 'airspyhf', 'rtlsdr', "
        "'hackrf' or 'soapy'",
        "line 6: [radio] bias_tee is 1, but must be true or false",
        "line 8: [antenna] pose_wait_s is -1, but must be at least 0.0",
        "line 9: [antenna] yaw_offset_deg is NaN, but must be a finite number",
        "line 11: [mavlink] tunnel_gap_s is 0.001, but must be at least 0.012",
        "line 12: [mavlink] component_id is 3.5, but must be a whole number",
        "line 13: [detection] is [{}], but must be a table with the heading [detection]",
    ]


@pytest.mark.parametrize(
    ("kind", "gain", "highest"),
    [("airspy", 22, 21), ("hackrf", 103, 102), ("soapy", 121, 120), ("rtlsdr", 51, 50)],
)
def test_a_gain_that_the_radio_does_not_have_is_refused_at_the_start(
    kind: str, gain: int, highest: int
) -> None:
    text = f'[radio]\nkind = "{kind}"\ngain = {{}}\n'
    with pytest.raises(ConfigError) as caught:
        parse_settings(text.format(gain).encode(), name="uavrt.toml")
    assert f"line 3: [radio] gain is {gain}, but must be" in caught.value.message
    settings = parse_settings(text.format(highest).encode(), name="uavrt.toml")
    assert settings.radio.gain == highest


@pytest.mark.parametrize(
    ("kind", "refused", "taken"),
    [
        ("airspy", (1e6, 2.4e6, 12e6), (2.5e6, 3e6, 6e6, 10e6)),
        ("airspyhf", (600e3,), (768e3, 192e3)),
        ("rtlsdr", (500e3, 225e3, 3.3e6), (250e3, 2.4e6)),
        ("hackrf", (1e6, 21e6), (3e6,)),
    ],
)
def test_a_sample_rate_that_the_radio_does_not_take_is_refused_at_the_start(
    kind: str, refused: tuple[float, ...], taken: tuple[float, ...]
) -> None:
    text = f'[radio]\nkind = "{kind}"\nsample_rate_hz = {{}}\n'
    for rate_hz in refused:
        with pytest.raises(ConfigError) as caught:
            parse_settings(text.format(rate_hz).encode(), name="uavrt.toml")
        said = f"line 3: [radio] sample_rate_hz is {rate_hz:.0f}, but must be"
        assert said in caught.value.message
    for rate_hz in taken:
        settings = parse_settings(text.format(rate_hz).encode(), name="uavrt.toml")
        assert settings.radio.sample_rate_hz == rate_hz
    program = text + 'program = ["of", "mine"]\n'
    parse_settings(program.format(refused[0]).encode(), name="uavrt.toml")


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (
            "lowest_m = 100\nhighest_m = 50",
            2,
            "lowest_m is 100 and highest_m 50, but the least height must be below the greatest",
        ),
        ("highest_m = 15.0", 2, "lowest_m is 20 and highest_m 15, but"),
        ("lowest_m = 120.0", 2, "lowest_m is 120 and highest_m 120, but"),
        (
            'enabled = true\nplanner = "nonsense"',
            3,
            "planner is \"nonsense\", but must be 'mi_rate'",
        ),
        ("wind_m_s = 12.0", 2, "wind_m_s is 12 and airspeed_m_s 12, but then the drone cannot"),
        ("airspeed_m_s = 6", 2, "wind_m_s is 8 and airspeed_m_s 6, but"),
    ],
)
def test_guidance_that_no_order_could_be_flown_with_is_refused_at_the_start(
    text: str, line: int, said: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_settings(f"[guidance]\n{text}\n".encode(), name="uavrt.toml")
    assert caught.value.message.splitlines()[0] == "uavrt.toml has 1 fault:"
    assert f"line {line}: [guidance] {said}" in caught.value.message


def test_guidance_that_fits_is_taken() -> None:
    text = (
        b"[guidance]\nlowest_m = 30\nhighest_m = 100.0\nplanner = 'mi_rate'\n"
        b"airspeed_m_s = 16\nwind_m_s = 11.0\nhover_w = 1200\nreturn_height_m = 15\n"
    )
    guidance = parse_settings(text, name="uavrt.toml").guidance
    assert (guidance.lowest_m, guidance.highest_m) == (30.0, 100.0)
    assert (guidance.planner, guidance.hover_w) == ("mi_rate", 1200.0)


def test_what_is_no_number_is_told_once() -> None:
    with pytest.raises(ConfigError, match="must be a number without quotes") as caught:
        parse_settings(b'[guidance]\nlowest_m = "200"\nplanner = 3\n', name="uavrt.toml")
    assert "has 2 faults" in caught.value.message


def test_the_settings_know_the_planners_that_there_are() -> None:
    """They stand in a layer below them."""
    assert list(PLANNERS)[: len(PLANNER_NAMES)] == list(PLANNER_NAMES)
    assert PLANNERS.group == PLANNER_GROUP


def test_a_mode_that_no_detector_has_is_refused_with_the_four() -> None:
    with pytest.raises(ConfigError, match="must be 'freqSearchSoftLock', 'freqSearchHardLock'"):
        parse_settings(b'[detection]\noperating_mode = "hard"\n', name="uavrt.toml")


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"[radio\n", "not TOML: "),
        (b"\xff\xfe\xff", "not text"),
        (b"a = " + b"[" * 5000, "nested more than 8 levels deep"),
        (b"#" * 300_000, "300,000 characters; a settings file can have at most 200,000"),
    ],
)
def test_what_is_not_toml_or_beyond_the_limits_is_refused(content: bytes, fault: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse_settings(content, name="uavrt.toml")
    assert fault in str(refused.value)
    assert ("not TOML" in str(refused.value)) == fault.startswith("not TOML")


def test_a_missing_file_is_refused_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml"):
        load_settings(tmp_path / "none.toml")


def test_the_schema_is_json_and_knows_the_ranges() -> None:
    schema = json.loads(json.dumps(settings_schema()))
    gap = schema["$defs"]["MavlinkSettings"]["properties"]["tunnel_gap_s"]
    assert gap["minimum"] == 0.012
