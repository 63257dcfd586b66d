"""Any text gives tags or all its faults; any tag survives a round trip."""

import contextlib
import re
import tempfile
from pathlib import Path

import made
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.config.loader import parse_settings
from uavrt.config.settings import Settings
from uavrt.config.tags.tag_files import parse_tags, read_tags, write_tags
from uavrt.core.errors import ConfigError, TagFileError
from uavrt.core.messages import Tag
from uavrt.core.units import s_from_ms

KEYS = (
    "id", "name", "frequency_mhz", "frequency_hz", "interval_ms", "second_interval_ms",
    "pulse_width_ms", "k", "false_alarm_probability", "freq_hz", "gain", "radio",
)  # fmt: skip
PIECES = (
    "[[tag]]\n", "[defaults]\n", "[tag]\n", "\nid=2\n", "=", ",", ";", "#", '"', "'", "\\", "[",
    "]", "{", "}", ".", "\n", "\r", "\t", " ", "\ufeff", '''"""''', "'''", "2", "148.71",
    "148710000", "1254", "20", "-1", "nan", "inf", "1e999", "0", "0.01", "3", "true",
    "9" * 5000, "- ", "\n  - ", "\n- id: 3", "gaps_ms:", "bi: ", ": ", "freq", "&", "\n  ",
)  # fmt: skip
WORDS = st.sampled_from(KEYS + PIECES)
SOUP = st.one_of(
    st.text(), st.lists(WORDS, max_size=40).map("".join), st.lists(WORDS).map(" ".join)
)


@given(
    st.one_of(SOUP.map(lambda s: s.encode("utf-8", "replace")), st.binary()),
    st.sampled_from(("toml", "txt", "yaml")),
)
@settings(max_examples=300)
def test_any_bytes_give_tags_or_faults_with_lines(content: bytes, ending: str) -> None:
    faults: tuple[str, ...] = ()
    tags: tuple[Tag, ...] = ()
    try:
        tags = parse_tags(content, name=f"t.{ending}")
    except TagFileError as error:
        faults = error.faults
    assert bool(tags) != bool(faults)
    assert all(re.match(r"line \d+: |\d+ bytes", fault) for fault in faults)


@given(st.one_of(SOUP.map(lambda s: s.encode("utf-8", "replace")), st.binary()))
@settings(max_examples=60)
def test_any_bytes_give_settings_or_a_config_error(content: bytes) -> None:
    with contextlib.suppress(ConfigError):
        assert isinstance(parse_settings(content, name="uavrt.toml"), Settings)


@st.composite
def tags(draw: st.DrawFn, *, toml: bool) -> Tag:
    def milliseconds(low: int, high: int) -> float:
        return s_from_ms(draw(st.integers(low * 1000, high * 1000)) / 1000)

    intervals = [milliseconds(300, 5000)]
    if toml and draw(st.booleans()):
        intervals.append(milliseconds(6000, 60000))
    name = st.text(st.characters(exclude_categories=["Cs"]))
    k = draw(st.integers(1, 100))
    return made.tag(
        draw(st.integers(1, 2**32 - 1)),
        draw(st.integers(20_000_000_000, 1_000_000_000_000)) / 1000,
        *tuple(intervals),
        pulse_width_s=milliseconds(1, 50),
        interval_uncertainty_s=milliseconds(0, min(149, 299 // max(1, k - 1))),
        interval_jitter_s=milliseconds(0, 149),
        k=k,
        false_alarm_probability=draw(st.integers(1, 500_000)) / 1_000_000,
        name=draw(st.none() | name) if toml else None,
    )


@pytest.mark.parametrize("name", ["tags.toml", "TagInfo.txt"])
@given(st.data())
def test_tags_survive_a_round_trip_through_a_file(name: str, data: st.DataObject) -> None:
    each = tags(toml=name == "tags.toml")
    written = data.draw(
        st.lists(each, min_size=1, max_size=5, unique_by=lambda tag: tag.tag_id)
    )
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / name
        write_tags(path, written)
        assert read_tags(path) == tuple(written)
