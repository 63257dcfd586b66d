"""Tag files as people write them, right and wrong."""

import re
from dataclasses import replace
from pathlib import Path

import made
import pytest
from some import some

from uavrt.config.tags.tag_files import faults_of_tags, parse_tags, read_tags, write_tags
from uavrt.core.errors import ConfigError, TagFileError
from uavrt.core.messages import DEFAULT_FALSE_ALARM_PROBABILITY
from uavrt.detection.detector_checks import check_searchable

HEADING = (
    "# id, freq_hz, ip_msecs, pulse_width_msecs, ip_uncertainty_msecs, ip_jitter_msecs, k, "
    "false_alarm\n"
)
THESIS_LINE = "2, 148710000, 1254, 20, 60, 10, 3, 0.005\n"
THESIS_TAG = made.tag(
    interval_uncertainty_s=0.060, interval_jitter_s=0.010, false_alarm_probability=0.005
)


def faults_of(text: str | bytes, name: str = "TagInfo.txt") -> tuple[str, ...]:
    content = text.encode() if isinstance(text, str) else text
    with pytest.raises(TagFileError) as caught:
        parse_tags(content, name=name)
    return caught.value.faults


@pytest.mark.parametrize(
    "content",
    [
        HEADING + THESIS_LINE,
        THESIS_LINE,
        HEADING.removeprefix("# ") + THESIS_LINE,
        "\n\n# my tags\n  2 ,148710000.0,\t1254,20,60 ,10,3,.005   # collar of Luna\n\n",
        THESIS_LINE.replace(", ", ";"),
        THESIS_LINE.replace(", ", "\t"),
        THESIS_LINE.replace(", ", "  "),
        (HEADING + THESIS_LINE).replace("\n", "\r\n"),
        (HEADING + THESIS_LINE).replace("\n", "\r"),
        "\ufeff" + HEADING + THESIS_LINE,
    ],
)
def test_the_thesis_tag_is_read_however_an_editor_saved_it(content: str) -> None:
    assert parse_tags(content.encode(), name="TagInfo.txt") == (THESIS_TAG,)


def test_a_file_saved_as_utf16_is_read() -> None:
    assert parse_tags(THESIS_LINE.encode("utf-16"), name="TagInfo.txt") == (THESIS_TAG,)


def test_all_faults_are_told_at_once_each_with_its_line() -> None:
    faults = faults_of(
        HEADING
        + THESIS_LINE
        + "2, 148.71, -3, nan, 60, 10, 0, 5\n"
        + "\n"
        + "4, abc, 1254, 20\n"
        + "6, x, 1254, inf, -1, 700, 1.5, 0\n"
    )
    assert faults == (
        "line 3: freq_hz 148.71 looks like MHz but is read as Hz: write 148710000",
        "line 3: ip_msecs -3 must be above 0 and at most 60000 ms",
        "line 3: pulse_width_msecs nan is not a finite number",
        "line 3: k 0 must be a whole number from 1 to 100",
        "line 3: false_alarm 5 must be above 0 and at most 0.5; 5 % is 0.05",
        "line 3: id 2 is already the tag of line 2",
        "line 5: 4 values instead of 8: id, freq_hz, ip_msecs, pulse_width_msecs, "
        "ip_uncertainty_msecs, ip_jitter_msecs, k, false_alarm",
        "line 6: freq_hz is 'x', not a number",
        "line 6: pulse_width_msecs inf is not a finite number",
        "line 6: ip_uncertainty_msecs -1 must not be negative",
        "line 6: k 1.5 must be a whole number from 1 to 100",
        "line 6: false_alarm 0 must be above 0 and at most 0.5",
        "line 6: ip_jitter_msecs 700 must be under half of the interval, ip_msecs 1254",
    )


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("2, 148710000, 1.254, 20, 0, 0, 3, .01", "is it in seconds? Write 1254"),
        ("2, 148710000, 1254, .02, 0, 0, 3, .01", "is it in seconds?"),
        ("2, 148710000, 1254, 20, 627, 0, 3, .01", "under half of the interval"),
        ("2, 148710, 1254, 20, 0, 0, 3, .01", "looks like kHz but is read as Hz"),
        ("2, 5, 1254, 20, 0, 0, 3, .01", "must be a frequency from 20 to 1000 MHz"),
        ("0, 148710000, 1254, 20, 0, 0, 3, .01", "id 0 must be a whole number"),
        ("2, 148710000, 1254, 20, 0, 0, 3, 0,01", "write numbers with a point"),
        ("2, 148710000, 1254, 20, 0, 0, 3, ", "false_alarm is nothing, not a number"),
        ("2, 1_48710000, 1254, 20, 0, 0, 3, .01", "not a number"),
        ("٢, 148710000, 1254, 20, 0, 0, 3, .01", "not a number"),
    ],
)
def test_an_impossible_line_is_refused_in_words_that_help(line: str, word: str) -> None:
    (fault,) = faults_of(line)
    assert fault.startswith("line 1: ")
    assert word in fault


def test_an_empty_file_has_no_tag_and_says_so() -> None:
    assert faults_of("# nothing yet\n") == ("line 1: this file contains no tag",)


def test_a_photo_is_not_a_tag_file() -> None:
    (fault,) = faults_of(b"\xff\xd8\xff\xe0\x00\x10JFIF")
    assert "save the file as UTF-8" in fault


def test_a_recording_given_as_tag_file_is_refused_by_its_size() -> None:
    (fault,) = faults_of(b"\0" * 1_000_001)
    assert "at most" in fault


def test_a_missing_file_is_refused_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no-such-file"):
        read_tags(tmp_path / "no-such-file.txt")


TOML = """\
[defaults]
pulse_width_ms = 15
k = 5

[[tag]]
id = 2
name = "Luna"
frequency_mhz = 148.710
interval_ms = 1333
second_interval_ms = 2000

[[tag]]
id = 4
frequency_hz = 150_123_456
interval_ms = 1254.5
pulse_width_ms = 20
interval_jitter_ms = 10
"""


def test_a_toml_file_has_names_second_intervals_and_shared_values() -> None:
    luna, other = parse_tags(TOML.encode(), name="tags.toml")
    usual = {"interval_uncertainty_s": 0.06, "interval_jitter_s": 0.01, "k": 5}
    assert luna == made.tag(
        2, 148_710_000.0, 1.333, 2.0, pulse_width_s=0.015, name="Luna", **usual
    )
    assert other == made.tag(4, 150_123_456.0, 1.2545, **usual)


@pytest.mark.parametrize("interval_ms", [60, 300, 1254, 2000, 60_000])
@pytest.mark.parametrize("k", [1, 3, 10, 40, 100])
@pytest.mark.parametrize("width_share", [0.05, 0.3, 0.49])
def test_an_uncertainty_that_is_not_given_can_be_searched(
    interval_ms: int, k: int, width_share: float
) -> None:
    text = f"""
        [[tag]]
        id = 2
        frequency_mhz = 148.7
        interval_ms = {interval_ms}
        pulse_width_ms = {min(width_share * interval_ms, 1000.0)}
        k = {k}
    """
    (tag,) = parse_tags(text.encode(), name="tags.toml")
    assert 0.0 < tag.interval_uncertainty_s <= 0.06
    assert 0.0 < tag.interval_jitter_s <= 0.01
    check_searchable(tag, 7500.0, tag.frequency_hz, 500.0)
    assert (k - 1) * tag.interval_uncertainty_s <= tag.pulse_intervals_s[0]


def test_toml_is_known_by_its_content_under_any_name() -> None:
    assert len(parse_tags(TOML.encode(), name="my tags.txt")) == 2


def test_all_faults_of_a_toml_file_are_told_at_once_each_with_its_line() -> None:
    faults = faults_of(
        """\
[[tag]]
id = 2
frequency_mhz = 148710
frequency_hz = 148710000
interval_ms = "1254"
pulse_widht_ms = 20
name = 7

[[tag]]
id = 2
frequency_mhz = inf
interval_ms = 1254
second_interval_ms = 1254
pulse_width_ms = 2000

[[tag]]
k = true
[[tag]]
k = 3
[radio]
""",
        name="tags.toml",
    )
    assert faults == (
        "line 3: frequency_mhz = 148710 looks like kHz but is read as MHz: write 148.71",
        "line 4: frequency is given twice, in MHz and in Hz",
        "line 5: interval_ms must be a number without quotes",
        "line 6: pulse_widht_ms is unknown here; did you mean pulse_width_ms?",
        'line 7: name must be text: name = "Luna"',
        "line 10: id 2 is already the tag of line 2",
        "line 11: frequency_mhz = inf is not a finite number",
        "line 13: second_interval_ms = 1254 is the same as the first interval; leave it out",
        "line 14: pulse_width_ms = 2000 must be 1 to 1000 ms",
        "line 16: this tag has no id",
        "line 16: this tag has no frequency_mhz",
        "line 16: this tag has no interval_ms",
        "line 16: this tag has no pulse_width_ms",
        "line 17: k must be a number without quotes",
        "line 18: this tag has no id",
        "line 18: this tag has no frequency_mhz",
        "line 18: this tag has no interval_ms",
        "line 18: this tag has no pulse_width_ms",
        "line 20: radio is unknown here; known are tag, defaults",
    )


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[[tag]]\nid = \n", "line 2: not TOML: invalid value"),
        ("[tag]\nid = 2\n", "line 1: write [[tag]] above each tag"),
        ("tag = [1]\n", "line 1: write [[tag]] above each tag"),
        ("defaults = 3\n", "line 1: write [defaults] as a heading"),
        (
            "a = " + "[" * 5000,
            "line 1: the content is nested more than 8 levels deep",
        ),
    ],
)
def test_a_toml_file_of_another_shape_is_refused(text: str, fault: str) -> None:
    assert faults_of(text, name="tags.toml")[0] == fault


@pytest.mark.parametrize("name", ["TagInfo.txt", "tags.toml"])
def test_the_thesis_tag_survives_a_round_trip(tmp_path: Path, name: str) -> None:
    write_tags(tmp_path / name, [THESIS_TAG])
    assert read_tags(tmp_path / name) == (THESIS_TAG,)


def test_tag_info_is_written_as_the_thesis_wrote_it(tmp_path: Path) -> None:
    write_tags(tmp_path / "TagInfo.txt", [THESIS_TAG])
    assert (tmp_path / "TagInfo.txt").read_text() == HEADING + THESIS_LINE


def test_a_second_interval_is_not_lost_silently_in_tag_info(tmp_path: Path) -> None:
    tags = parse_tags(TOML.encode(), name="tags.toml")
    with pytest.raises(ConfigError, match=r"second interval \(tags \[2\]\)"):
        write_tags(tmp_path / "TagInfo.txt", tags)
    assert not (tmp_path / "TagInfo.txt").exists()


def test_a_directory_that_is_not_there_is_told_on_writing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot write the tag file"):
        write_tags(tmp_path / "none" / "TagInfo.txt", [THESIS_TAG])


@pytest.mark.parametrize(
    "name", ["tags.csv", "tags", "detectorConfig.txt", "flight.sigmf-meta"]
)
def test_no_tags_are_written_under_a_name_that_is_another_formats(
    tmp_path: Path, name: str
) -> None:
    with pytest.raises(ConfigError, match=r"Choose a name that ends in \.toml"):
        write_tags(tmp_path / name, [THESIS_TAG])
    assert not (tmp_path / name).exists()


def test_tags_from_elsewhere_are_judged_by_the_rules_of_the_files() -> None:
    double = replace(THESIS_TAG, tag_id=4, pulse_intervals_s=(1.333, 2.0), name="Luna")
    assert faults_of_tags([THESIS_TAG, double]) == []
    wrong = replace(double, frequency_hz=-39.8, pulse_width_s=1.4, k=0)
    assert faults_of_tags([THESIS_TAG, wrong]) == [
        "tag 4: frequency -39.8 Hz must be a frequency from 20 to 1000 MHz",
        "tag 4: pulse_width_ms 1400 must be 1 to 1000 ms",
        "tag 4: k 0 must be a whole number from 1 to 100",
    ]


SLIDING = """\
[[tag]]
id = 2
frequency_mhz = 148.71
interval_ms = 1254
pulse_width_ms = 20
frequency_slide_hz = -380
"""


def test_a_frequency_slide_is_kept_by_toml_and_refused_by_taginfo(tmp_path: Path) -> None:
    (tag,) = parse_tags(SLIDING.encode(), name="tags.toml")
    assert tag.frequency_slide_hz == -380.0
    write_tags(tmp_path / "tags.toml", [tag])
    assert read_tags(tmp_path / "tags.toml") == (tag,)
    assert faults_of_tags([replace(tag, frequency_slide_hz=501.0)]) == [
        "tag 2: frequency_slide_hz 501 must be at most 500 Hz, up or down"
    ]
    with pytest.raises(ConfigError, match="no column for a frequency slide"):
        write_tags(tmp_path / "TagInfo.txt", [tag])
    coded = 'kind = "coded"\ngaps_ms = [42.0, 48.8]\nburst_interval_s = 5.3\n'
    (fault,) = faults_of(SLIDING.replace("interval_ms = 1254\n", coded), "tags.toml")
    assert fault == "line 8: frequency_slide_hz = -380 is only for a beeping tag"


def test_the_default_false_alarm_probability_is_the_same_wherever_a_tag_comes_from() -> None:
    root = Path(__file__).parents[3]
    (tag,) = parse_tags(
        b"[[tag]]\nid = 2\nfrequency_mhz = 148.71\ninterval_ms = 1254\npulse_width_ms = 20\n",
        name="tags.toml",
    )
    page = (root / "page/src/settings/setup.ts").read_text(encoding="utf-8")
    manual = (root / "docs/reference/tag-files.md").read_text(encoding="utf-8")
    on_page = re.search(r"DEFAULT_FALSE_ALARM_PERCENT = ([\d.]+);", page)
    in_manual = re.search(r"^\| `false_alarm_probability` \|[^|]*\| ([\d.]+) \|", manual, re.M)
    assert tag.false_alarm_probability == DEFAULT_FALSE_ALARM_PROBABILITY
    assert float(some(on_page)[1]) == pytest.approx(100.0 * DEFAULT_FALSE_ALARM_PROBABILITY)
    assert float(some(in_manual)[1]) == DEFAULT_FALSE_ALARM_PROBABILITY


@pytest.mark.parametrize(
    "line",
    [
        "2;luna;146123456;1333;2000;15;60;20;3;0,01",
        "2\tluna\t146123456\t1333\t2000\t15\t60\t20\t3\t0,01",
        "2,luna,146123456,1333,2000,15,60,20,3,0.01,",
        "2;luna;146123456,0;1333,5;2000;15;60;20;3;0,01;",
    ],
)
def test_tags_with_a_name_are_read_with_any_separator_and_decimal_commas(line: str) -> None:
    (tag,) = parse_tags(f"{line}\n".encode(), name="TagInfo.txt")
    assert (tag.tag_id, tag.name, tag.frequency_hz) == (2, "luna", 146_123_456.0)
    assert tag.pulse_intervals_s[0] == pytest.approx(1.333, abs=0.001)
    assert tag.pulse_intervals_s[1] == 2.0
    assert tag.false_alarm_probability == 0.01


@pytest.mark.parametrize(
    "line", ["2;146123456;1333;15;60;20;3;0,01", "2,146123456,1333,15,60,20,3,0.01,,"]
)
def test_lines_of_the_original_are_read_with_decimal_commas_and_filled(line: str) -> None:
    (tag,) = parse_tags(f"{line}\n".encode(), name="TagInfo.txt")
    assert tag.false_alarm_probability == 0.01
