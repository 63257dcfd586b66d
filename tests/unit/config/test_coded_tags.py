"""Coded tags in tag files: TOML as ours, lists in CSV and YAML, and all faults at once."""

import sys
from dataclasses import replace
from pathlib import Path

import made
import pytest
import yaml

from uavrt.config.tags.code_rules import near_codes, words_of_near_codes
from uavrt.config.tags.tag_files import parse_tags, read_tags, write_tags
from uavrt.core.errors import ConfigError, TagFileError, UsageError

TOML = """\
[defaults]
frequency_mhz = 166.38
interval_ms = 1254      # of the beeping tags
pulse_width_ms = 20

[[tag]]
id = 12
name = "Robin"
kind = "coded"
gaps_ms = [22.0, 48.8, 36.6]
burst_interval_s = 5.3

[[tag]]
id = 14
"""
CODE = made.tag(
    12,
    166_380_000.0,
    5.3,
    name="Robin",
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0488, 0.0366),
)


def test_a_coded_tag_stands_beside_a_beeping_one() -> None:
    coded, beeping = parse_tags(TOML.encode(), name="tags.toml")
    assert coded == CODE
    assert coded.coded
    assert coded.length_s == pytest.approx(0.1099)
    assert not beeping.coded
    assert beeping.pulse_intervals_s == (1.254,)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("list.csv", "proj,id,name,tagFreq,g1,g2,g3,bi\nx,12,Robin,166.38,22,48.8,36.6,5.3\n"),
        ("list.txt", "id;name;nomFreq;gaps_ms;period\n12;Robin;166.38;22 48.8 36.6;5.3\n"),
        (
            "list.yaml",
            "tags:\n  - id: 12\n    name: Robin\n    frequency_mhz: 166.38\n"
            "    gaps_ms: [22.0, 48.8, 36.6]  # as registered\n    burst_interval_s: 5.3\n",
        ),
    ],
)
def test_lists_as_people_have_them_are_read(name: str, text: str, tmp_path: Path) -> None:
    tags = parse_tags(text.encode(), name=name)
    assert tags == (CODE,)
    write_tags(tmp_path / "tags.toml", tags)
    assert read_tags(tmp_path / "tags.toml") == tags
    with pytest.raises(ConfigError, match="no columns for coded tags"):
        write_tags(tmp_path / "TagInfo.txt", tags)


def assert_faults(name: str, text: str, *told: str) -> None:
    """A file has these faults and no others."""
    with pytest.raises(TagFileError) as caught:
        parse_tags(text.encode(), name=name)
    for words in told:
        assert any(words in fault for fault in caught.value.faults), words
    assert len(caught.value.faults) == len(told)


def _entry(number: int, gaps: str, interval_s: str) -> str:
    head = f"[[tag]]\nid = {number}\nfrequency_mhz = 166.38\n"
    return f'{head}kind = "coded"\ngaps_ms = {gaps}\nburst_interval_s = {interval_s}\n'


def test_all_faults_of_codes_are_told_at_once_each_with_its_line() -> None:
    text = (
        _entry(1, "[0.022, 0.0488, 0.0366]", "5.3")
        + _entry(2, "[22, 48.8, 36.6]", "5300")
        + _entry(3, "[22, 48.8, 3.6]", "5.3")
        + _entry(4, "[22, 48.8, 36]", "0.1")
        + _entry(5, "[22, 48.8, 36]", "5.3")
        + _entry(6, "[22, 48.8, 36]", "5.3")
        + "[[tag]]\nid = 7\nfrequency_mhz = 166.38\ngaps_ms = [22, 48.8, 36]\n"
        + _entry(8, '"22"', "5.3")
        + _entry(9, "[22000, 48800, 36600]", "5.3")
    )
    with pytest.raises(TagFileError) as caught:
        parse_tags(text.encode(), name="tags.toml")
    told = {
        5: "looks like seconds but is read as ms: write 22, 48.8, 36.6",
        12: "looks like ms but is read as s: write 5.3",
        17: "they would overlap",
        24: "must be longer than the burst; its gaps add up to 109.3 ms",
        31: "the same code, gaps and burst interval, as the tag of line 25",
        40: 'write kind = "coded"',
        45: "a coded tag has gaps_ms",
        51: "looks like µs",
    }
    assert len(caught.value.faults) == len(told)
    for fault, (line, words) in zip(caught.value.faults, told.items(), strict=True):
        assert fault.startswith(f"line {line}: ")
        assert words in fault


def test_too_many_codes_are_refused_and_faults_of_a_csv_have_lines() -> None:
    rows = "\n".join(f"{i},166.38,{20 + 0.1 * i:.1f},48.8,36.6,5.3" for i in range(1, 601))
    with pytest.raises(TagFileError, match="line 502: the list has 600 codes, but at most 500"):
        parse_tags(f"id,tagFreq,g1,g2,g3,bi\n{rows}\n".encode(), name="list.csv")
    with pytest.raises(
        TagFileError, match=r"(?s)line 2: g2 is 'x'.*line 3: this tag has no bur"
    ):
        parse_tags(b"id,freq,g1,g2,bi\n1,150,22,x,5\n2,150,22,30,\n", name="list.csv")


def test_codes_nearer_than_the_tolerance_are_named() -> None:
    texts = [_entry(1, "[22, 48.8, 36]", "5.3"), _entry(2, "[22.5, 48.8, 36.5]", "5.9")]
    tags = parse_tags(
        (texts[0] + texts[1] + _entry(3, "[24, 48.8, 36]", "5.3")).encode(), name=""
    )
    assert [(a.tag_id, b.tag_id) for a, b, _ in near_codes(tags, 500.0)] == [(1, 2)]
    (words,) = words_of_near_codes(tags, 500.0)
    assert words.startswith("codes 1 and 2 are too similar: their gaps differ by 1 ms")


def test_a_column_that_is_not_known_is_named_where_something_is_missing() -> None:
    text = "id,mhz,colour,g1,g2,bi\n1,150.34,red,22,30,5\n"
    said = "line 2: this tag has no frequency_mhz; mhz, colour are not known here"
    assert_faults("codes.csv", text, said)


def test_gaps_that_are_no_numbers_or_lack_one_are_faults_with_their_line() -> None:
    text = (
        "id,tagFreq,g1,g2,g3,bi\n1,166.38,22,nan,36.6,5.3\n2,166.38,22,,36.6,5.3\n"
        "3,166.38,22,30,36.6,inf\n4,166.38,,,,5.3\n"
    )
    assert_faults(
        *("codes.csv", text, "line 2: gaps_ms = [22, nan", "line 4: burst_interval_s = inf"),
        *("line 3: this tag has gap 3, but no gap 2", "line 5: this tag has no gaps"),
    )
    with pytest.raises(TagFileError, match=r"no gaps .*; gaps_s is not known here"):
        parse_tags(b"- id: 3\n  freq: 166.38\n  gaps_s: [0.02]\n  bi: 5\n", name="a.yaml")


@pytest.mark.parametrize(("interval_s", "same"), [("5.3019", True), ("5.3041", False)])
def test_codes_are_the_same_within_the_tolerance_of_the_interval(
    interval_s: str, same: bool
) -> None:
    text = _entry(1, "[22, 48.8, 36]", "5.3") + _entry(2, "[22.004, 48.8, 36]", interval_s)
    if same:
        assert_faults("tags.toml", text, "line 7: the same code")
    else:
        tags = parse_tags(text.encode(), name="tags.toml")
        assert len(near_codes(tags, 500.0)) == 1


DUMPED = """\
# as PyYAML writes it
- burst_interval_s: 5.3
  frequency_mhz: 166.38
  gaps_ms:
  - 22.0
  - 48.8   # by hand
  - 36.6
  id: 12
  name: 'Robin'
"""
IN_BRACKETS = """\
- {id: 12, name: "Robin", frequency_mhz: 166.38,
   gaps_ms: [22.0, 48.8,
     36.6], burst_interval_s: 5.3}
"""
BY_NAME = """\
---
Robin:
    id: 12
    freq: 166.38
    gaps_ms:
        - 22.0
        - 48.8
        - 36.6
    bi: 5.3
    note: null
"""
BY_NUMBER = """\
codes:
  12: {name: Robin, freq: 166.38, g1: 22, g2: 48.8, g3: 36.6, bi: 5.3}
"""


@pytest.mark.parametrize("text", [DUMPED, IN_BRACKETS, BY_NAME, BY_NUMBER])
def test_yaml_is_read_as_programs_write_it(text: str) -> None:
    assert parse_tags(text.encode(), name="codes.yaml") == (CODE,)


def test_what_pyyaml_writes_of_a_list_is_read_in_all_its_styles() -> None:
    one = {"id": 12, "name": "Robin", "freq": 166.38, "gaps_ms": [22.0, 48.8, 36.6], "bi": 5.3}
    two = {**one, "id": 13, "name": "It's: #1", "gaps_ms": [30.0, 48.8, 36.6]}
    other = replace(CODE, tag_id=13, name="It's: #1", gaps_s=(0.030, 0.0488, 0.0366))
    lists: list[object] = [[one, two], {"tags": [one, two]}, {"a": one, "b": two}]
    for flow in (None, True, False):
        for content in lists:
            text = yaml.safe_dump(content, default_flow_style=flow)
            assert parse_tags(text.encode(), name="a.yaml") == (CODE, other), text


def test_faults_of_yaml_are_told_at_once_each_with_its_line() -> None:
    text = (
        "- id: 1\n  freq: 166.38\n  gaps_ms:\n  - 22.0\n  - x\n  bi: 5.3\n"
        "- {id: 2, freq: 166380, gaps_ms: [30, 40], bi: 5.3}\n"
        "- {id: 3, freq: 166.38, gaps_ms: [31,\n    y], bi: 5.3}\n"
        "- id: &four 4\n  freq: 166.38\n  g1: 22\n  freq: 166.38\n  ? [a]\n  : b\n"
        "- just words\n"
    )
    assert_faults(
        "codes.yaml",
        text,
        "line 5: gaps_ms is 'x', not a number",
        "line 7: freq 166380 looks like kHz",
        "line 9: gaps_ms is 'y', not a number",
        "line 10: this tag has no burst_interval_s",
        "line 13: freq is given twice",
        "line 14: a key is a list or a mapping instead of a name",
        "line 16: not a list of tags",
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("- {id: 6, freq: 166.38\n- id: 7\n", "line 2: not YAML: while parsing a flow"),
        ("- id: 7\n\tfreq: 166.38\n", "line 2: not YAML: while scanning"),
        ("- id: 7\n- \x00\n", "line 2: not YAML: it contains a control character"),
        ("- &a [1, 2]\n- [*a, *a]\n", "line 2: not YAML: aliases"),
        ("- id: 1\n- " + 3_000 * "[", "line 2: not YAML: nested too deeply"),
        ("- " + 25_000 * "\n- ", "line 20000: not YAML: more values"),
        ("\n- !!python/object:os.system x\n", "line 2: not a list of tags"),
    ],
)
def test_what_is_no_yaml_is_told_with_its_line(text: str, told: str) -> None:
    with pytest.raises(TagFileError) as caught:
        parse_tags(text.encode(), name="codes.yaml")
    assert caught.value.faults[-1].startswith(told)


def test_without_pyyaml_a_list_in_yaml_names_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(UsageError) as caught:
        parse_tags(DUMPED.encode(), name="codes.yaml")
    assert "uavrt[ground]" in str(caught.value.remedy)


def test_all_faults_within_one_tag_are_told_at_once() -> None:
    for gaps, interval_s, told in [
        ("[22, 48.8, 3.6]", "0.06", ["they would overlap", "must be longer than the burst"]),
        ("[0.022, 0.0488]", "0.05", ["looks like seconds", "must be longer than the burst"]),
        ("[22, 48.8, 36]", "65", ["looks like ms", "must be longer than the burst"]),
        ("[22, 1500]", "5300", ["at most 1000 ms", "looks like ms"]),
        ("[22, true]", "65", ["numbers in brackets", "looks like ms"]),
    ]:
        assert_faults("tags.toml", _entry(1, gaps, interval_s), *told)


def test_a_misspelt_key_hides_no_other_that_is_missing() -> None:
    text = (
        '[[tag]]\nfrequency_mhz = 166.38\nkind = "coded"\ngap_ms = [22, 30]\ncolour = "red"\n'
    )
    told = ["did you mean gaps_ms", "colour is unknown", "no id", "no burst_interval_s"]
    assert_faults("tags.toml", text, "a coded tag has gaps_ms", *told)
    beeping = "[[tag]]\nfrequency_mhz = 148.7\nintervall_ms = 1254\nk = 1.5\n"
    told = ["did you mean interval_ms", "no id", "no pulse_width_ms", "must be a whole number"]
    assert_faults("tags.toml", beeping, *told)


def test_all_faults_within_one_row_are_told_at_once() -> None:
    text = (
        "id,tagFreq,g1,g2,g3,bi\n7,166.38,22,x,36,\n10,166380,50,51,2\n"
        "11,166.38,1,2,3,4,5\ny,166.38,22,,36,z\n"
    )
    assert_faults(
        "codes.csv",
        text,
        "line 2: g2 is 'x', not a number",
        "line 2: this tag has no burst_interval_s",
        "line 3: 5 values where the heading has 6, none for bi",
        "line 3: tagFreq 166380 looks like kHz",
        "line 3: gaps_ms = [50, 51, 2] must be longer than two pulses",
        "line 4: 7 values where the heading has 6",
        "line 5: id is 'y', not a number",
        "line 5: bi is 'z', not a number",
        "line 5: this tag has gap 3, but no gap 2",
    )
