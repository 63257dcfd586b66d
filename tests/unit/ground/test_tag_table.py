"""Tags as people type and keep them."""

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_texts import in_german

from uavrt.core.errors import UsageError
from uavrt.ground.store.tag_table import (
    FIELDS,
    PRESETS,
    FieldFault,
    export_text,
    import_rows,
    not_selected,
    rows_from_tags,
    slides_not_sent,
    tags_from_rows,
    warnings_of,
)

ROW = {
    "id": 4,
    "name": "otter, the second",
    "frequency_mhz": "148.697",
    "interval_ms": "1333",
    "second_interval_ms": 2000,
    "pulse_width_ms": 15,
    "interval_uncertainty_ms": 60,
    "interval_jitter_ms": 20,
    "k": 3,
    "false_alarm_percent": "0.5",
}
CODED_ROW = {
    "id": 30,
    "name": "bat",
    "frequency_mhz": "148.69",
    "kind": "coded",
    "interval_ms": "4700",
    "gaps_ms": "22 48.8 36.6",
}
TRACKER_TAGS = (
    "selected,id,name,manufacturerId,freqMHz\n1,2,luna,1,146.123456\n0,4,sol,2,146.2\n"
)
TRACKER_MAKERS = (
    "id,name,ip_msecs_1,ip_msecs_2,ip1_id,ip2_id,pulse_width,uncertainty,jitter\n"
    "1,Two,1333,2000,Moving,Resting,15,60,20\n2,One,1254,0,-,-,20,60,10\n"
)


def faults_of(*rows: dict[str, object]) -> list[FieldFault]:
    """What is wrong with rows that give no tag, each in words that the page has."""
    tags, faults = tags_from_rows(list(rows))
    assert tags == ()
    assert [fault.text for fault in faults if in_german(fault.text)[1]] == []
    return faults


def test_a_row_becomes_a_tag_in_our_units() -> None:
    (tag,), faults = tags_from_rows([ROW])
    assert faults == []
    assert tag == made.tag(
        4,
        148_697_000.0,
        1.333,
        2.0,
        pulse_width_s=0.015,
        interval_uncertainty_s=0.06,
        interval_jitter_s=0.02,
        false_alarm_probability=0.005,
        name="otter, the second",
    )


@pytest.mark.parametrize(
    ("field", "written", "says"),
    [
        ("frequency_mhz", "148697000", "write 148.697"),
        ("frequency_mhz", "148697", "looks like kHz"),
        ("frequency_mhz", "1.5", "20 to 1000 MHz"),
        ("frequency_mhz", "", "field is empty"),
        ("frequency_mhz", "abc", "not a number"),
        ("interval_ms", "1.333", "Write 1333"),
        ("interval_ms", "2", "is it in seconds"),
        ("interval_ms", "0", "above 0 and at most 60000 ms"),
        ("pulse_width_ms", "0.015", "seconds"),
        ("pulse_width_ms", "4000", "1 to 1000 ms"),
        ("pulse_width_ms", "650", "less interval_uncertainty_ms"),
        ("interval_uncertainty_ms", "700", "under half of the interval"),
        ("id", "0", "whole number"),
        ("id", "2.5", "whole number"),
        ("k", "0", "whole number"),
        ("false_alarm_percent", "100", "above 0 and at most 50 %"),
        ("false_alarm_percent", "nan", "not a number"),
        ("false_alarm_percent", "0.005", "probability 0.005 is 0.5 %"),
        ("interval_jitter_ms", "-1", "negative"),
        ("second_interval_ms", "1333", "same"),
        ("name", "x" * 61, "60"),
        ("name", "a\x1b[2Jb", "printable"),
    ],
)
def test_a_mistake_is_told_at_its_field(field: str, written: str, says: str) -> None:
    faults = faults_of(ROW | {field: written})
    assert {fault.field for fault in faults} == {field}, "what is right is not marked"
    assert any(says in fault.text for fault in faults)
    assert all(fault.row == 0 for fault in faults)


@pytest.mark.parametrize(
    ("written", "field", "says"),
    [
        ({"interval_ms": 200, "pulse_width_ms": 400}, "pulse_width_ms", "shorter than the"),
        ({"interval_uncertainty_ms": 500, "k": 90}, "k", "too large for interval_uncertainty"),
        ({"kind": "beeping", "gaps_ms": "22"}, "gaps_ms", "must be empty"),
    ],
)
def test_what_does_not_fit_together_is_told_at_one_field(
    written: dict[str, object], field: str, says: str
) -> None:
    (fault,) = faults_of(ROW | written)
    assert fault.field == field
    assert says in fault.text


@pytest.mark.parametrize("written", ["0.005 %", "0.005%", "0,005 %"])
def test_a_percentage_with_its_sign_is_what_it_says(written: str) -> None:
    (tag,), _ = tags_from_rows([ROW | {"false_alarm_percent": written}])
    assert tag.false_alarm_probability == pytest.approx(5e-5)
    assert tags_from_rows(rows_from_tags([tag])) == ((tag,), [])


def test_an_id_or_a_code_used_twice_is_told_at_the_second() -> None:
    for rows, field in (((ROW, ROW), "id"), ((CODED_ROW, CODED_ROW | {"id": 31}), "gaps_ms")):
        (fault,) = faults_of(*rows)
        assert (fault.row, fault.field) == (1, field)


@given(
    st.lists(
        st.dictionaries(
            st.sampled_from([*FIELDS, "name", "other"]),
            st.one_of(
                st.none(), st.text(max_size=12), st.integers(), st.floats(), st.booleans()
            ),
        ),
        max_size=4,
    )
)
def test_whatever_is_typed_is_tags_or_faults_never_both(rows: list[dict[str, object]]) -> None:
    tags, faults = tags_from_rows(rows)
    assert not (tags and faults)
    assert len(tags) == len(rows) or faults
    for fault in faults:
        assert 0 <= fault.row < len(rows)
        assert fault.field in (*FIELDS, "name")
        assert fault.text


def test_rows_and_files_come_back_as_they_were() -> None:
    tags, _ = tags_from_rows([ROW])
    assert tags_from_rows(rows_from_tags(tags))[0] == tags
    for name in ("tags.toml", "tags.csv"):
        rows = import_rows({name: export_text(tags, name)})
        assert tags_from_rows(rows)[0] == tags


def test_tag_info_is_read_and_refuses_two_rates() -> None:
    tags, _ = tags_from_rows([ROW | {"second_interval_ms": ""}])
    (row,) = import_rows({"TagInfo.txt": export_text(tags, "TagInfo.txt")})
    assert row["frequency_mhz"] == 148.697
    double, _ = tags_from_rows([ROW])
    with pytest.raises(UsageError, match="second interval"):
        export_text(double, "TagInfo.txt")


@pytest.mark.parametrize("heading", [True, False], ids=["heading", "no heading"])
@pytest.mark.parametrize("separator", [",", ";", "\t"], ids=["comma", "semicolon", "tab"])
def test_tagtrackers_databases_are_read_as_it_writes_them(
    separator: str, *, heading: bool
) -> None:
    files = {}
    for name, text in (("TagInfo.db", TRACKER_TAGS), ("TagManufacturer.db", TRACKER_MAKERS)):
        lines = text.splitlines()[0 if heading else 1 :]
        files[name] = "\r\n".join(line.replace(",", separator) for line in lines) + "\r\n"
    tags, faults = tags_from_rows(import_rows(files))
    assert faults == []
    assert [(tag.tag_id, tag.name) for tag in tags] == [(2, "luna"), (4, "sol")]
    assert [tag.pulse_intervals_s for tag in tags] == [(1.333, 2.0), (1.254,)]
    assert [tag.frequency_hz for tag in tags] == [146_123_456.0, 146_200_000.0]
    with pytest.raises(UsageError, match="together"):
        import_rows({"TagInfo.db": files["TagInfo.db"]})


def test_tags_that_tagtracker_has_not_selected_are_left_out_of_the_flight() -> None:
    makers = {"TagManufacturer.db": TRACKER_MAKERS}
    assert not_selected({"TagInfo.db": TRACKER_TAGS} | makers) == (4,)
    without_heading = (
        "true; 2; luna; 1; 146.1\nfalse; 4; sol; 2; 146.2\nFalse; 6; ys; 2; 146.3\n"
    )
    assert not_selected({"TagInfo.db": without_heading} | makers) == (4, 6)
    without_column = "id,name,manufacturerId,freqMHz\n2,luna,1,146.1\n"
    assert not_selected({"TagInfo.db": without_column} | makers) is None
    assert not_selected({"tags.csv": export_text(tags_from_rows([ROW])[0], "tags.csv")}) is None


def test_a_maker_without_a_name_is_a_maker() -> None:
    files = {
        "TagInfo.db": "1, 2, otter, 0, 148.7\n",
        "TagManufacturer.db": "0, , 1333, 2000, Moving, Resting, 15, 60, 20\n",
    }
    (row,) = import_rows(files)
    assert (row["interval_ms"], row["second_interval_ms"]) == ("1333", "2000")


def test_a_comma_in_tagtrackers_name_breaks_no_column() -> None:
    files = {
        "TagInfo.db": "1, 2, otter, the second, 1, 146.123456\n",
        "TagManufacturer.db": "1, Tags, Ltd., 1333, 0, Moving, , 15, 60, 20\n",
    }
    (tag,), faults = tags_from_rows(import_rows(files))
    assert faults == []
    assert tag.name == "otter, the second"
    assert tag.pulse_intervals_s == (1.333,)


@pytest.mark.parametrize("separator", [", ", ";", "\t"], ids=["comma", "semicolon", "tab"])
@pytest.mark.parametrize("heading", [True, False], ids=["heading", "no heading"])
def test_tagtrackers_tag_info_of_ten_columns_is_read(separator: str, *, heading: bool) -> None:
    lines = [
        "2, luna, 146123456, 1333, 2000, 15, 60, 20, 3, 0.01",
        "4, sol, 146200000, 1254, 0, 20, 60, 10, 5, 0.05",
    ]
    if heading:
        names = "id, name, freq_hz, ip_msecs_1, ip_msecs_2, pulse_width_msecs, "
        names += "ip_uncertainty_msecs, ip_jitter_msecs, k, false_alarm"
        lines.insert(0, f"# {names}")
    text = "\n".join(line.replace(", ", separator) for line in lines)
    tags, faults = tags_from_rows(import_rows({"TagInfo.txt": text}))
    assert faults == []
    assert [(t.name, t.k, t.pulse_intervals_s) for t in tags] == [
        ("luna", 3, (1.333, 2.0)),
        ("sol", 5, (1.254,)),
    ]
    assert [tag.false_alarm_probability for tag in tags] == [0.01, 0.05]


def test_our_own_table_comes_back_from_a_spreadsheet() -> None:
    tags, _ = tags_from_rows([ROW | {"name": "otter"}])
    written = export_text(tags, "tags.csv").replace(",", ";").replace("148.697", "148,697")
    assert tags_from_rows(import_rows({"tags.csv": written}))[0] == tags


def test_every_preset_is_a_possible_tag() -> None:
    for preset in PRESETS:
        row = {**preset, "id": 2, "name": "", "frequency_mhz": 150, "k": 3}
        assert tags_from_rows([row | {"false_alarm_percent": 1}])[1] == []


def test_a_coded_tag_comes_back_from_its_row_and_from_every_file_with_room_for_it() -> None:
    tags, faults = tags_from_rows([CODED_ROW, ROW])
    assert faults == []
    assert (tags[0].gaps_s, tags[0].pulse_intervals_s) == ((0.022, 0.0488, 0.0366), (4.7,))
    assert (tags[0].pulse_width_s, tags[0].interval_uncertainty_s, tags[0].k) == (
        0.0025,
        0.004,
        10,
    )
    row, beeping = rows_from_tags(tags)
    assert (row["kind"], row["gaps_ms"]) == ("coded", "22 48.8 36.6")
    assert not {"kind", "gaps_ms"} & set(beeping), "as ever"
    assert tags_from_rows([row, beeping]) == (tags, [])
    for name in ("tags.csv", "tags.toml"):
        rows = import_rows({name: export_text(tags, name)})
        assert tags_from_rows(rows) == (tags, [])
    (read,) = import_rows({"codes.csv": "id,tagFreq,g1,g2,g3,bi\n7,148.69,22,48.8,36.6,4.7\n"})
    assert (read["gaps_ms"], read["interval_ms"]) == ("22 48.8 36.6", 4700)


@pytest.mark.parametrize(
    ("field", "written", "says"),
    [
        ("gaps_ms", "", "field is empty"),
        ("gaps_ms", "22 x", "numbers separated by spaces"),
        ("gaps_ms", "0.022, 0.0488, 0.0366", "looks like seconds"),
        ("gaps_ms", "26200 52400", "looks like µs"),
        ("gaps_ms", "26.2 52400", "at most 1000 ms"),
        ("gaps_ms", "4 48.8 36.6", "overlap"),
        ("gaps_ms", " ".join(["30"] * 8), "1 to 7 gaps"),
        ("kind", "pinger", "beeping or coded"),
        ("interval_ms", "100", "longer than the burst"),
        ("second_interval_ms", "2000", "one interval"),
    ],
)
def test_a_fault_of_a_code_stands_at_its_field(field: str, written: str, says: str) -> None:
    (fault,) = faults_of(CODED_ROW | {field: written})
    assert (fault.row, fault.field) == (0, field)
    assert says in fault.text


def test_codes_that_are_near_are_named_in_words_that_the_page_has() -> None:
    near = CODED_ROW | {"id": 14, "gaps_ms": "22.4 48.8 36.6"}
    tags, faults = tags_from_rows([CODED_ROW, near, ROW])
    assert not faults
    (words,) = warnings_of(tags)
    assert words.startswith(f"codes {CODED_ROW['id']} and 14 are too similar")
    assert not in_german(words)[1]
    assert warnings_of(tags_from_rows([CODED_ROW, ROW])[0]) == []


def test_an_import_says_that_frequency_slides_are_not_sent() -> None:
    sliding = [made.tag(3, frequency_slide_hz=400.0), made.tag(4)]
    files = {"tags.toml": export_text(sliding, "tags.toml")}
    assert slides_not_sent(files) == [
        "the frequency slides of tags 3 are not sent to the drone"
    ]
    assert slides_not_sent({"tags.toml": export_text(sliding[1:], "tags.toml")}) == []
