"""Single settings are changed, and nothing else in the file."""

import tomllib
from pathlib import Path

import pytest

from uavrt.config.loader import default_settings_text, load_settings
from uavrt.config.setting_writer import change_settings
from uavrt.core.errors import ConfigError

BY_HAND = """\
# Lynx, the drone with the blue arms
[mavlink]
direct_links = [
    "udpin://127.0.0.1:14560",  # the page
    "udpin://0.0.0.0:14561",
]
address = "serial:///dev/ttyAMA0:921600"  # TELEM2

[radio]
kind = "rtlsdr"
gain = 20
"""


def test_what_is_changed_is_read_again_and_comments_stay(tmp_path: Path) -> None:
    path = tmp_path / "uavrt.toml"
    path.write_text(BY_HAND)
    path.chmod(0o660)
    change_settings(path, {("radio", "kind"): "hackrf", ("antenna", "yaw_offset_deg"): 90.0})
    change_settings(path, {("mavlink", "direct_links"): None, ("radio", "gain"): None})
    settings = load_settings(path)
    assert (settings.radio.kind, settings.radio.gain) == ("hackrf", None)
    assert settings.antenna.yaw_offset_deg == 90.0
    assert settings.mavlink.direct_links == ()
    assert settings.mavlink.address == "serial:///dev/ttyAMA0:921600"
    text = path.read_text()
    assert text.startswith("# Lynx")
    assert "# TELEM2" in text
    assert path.stat().st_mode & 0o777 == 0o660


def test_a_setting_of_the_default_file_takes_its_own_line(tmp_path: Path) -> None:
    path = tmp_path / "uavrt.toml"
    change_settings(path, {("radio", "gain"): 12, ("mavlink", "key_file"): "/a b/ü.key"})
    assert load_settings(path).mavlink.key_file == "/a b/ü.key"
    before, after = default_settings_text().split("\n"), path.read_text().split("\n")
    assert len(before) == len(after)
    changed = [new for old, new in zip(before, after, strict=True) if old != new]
    assert changed == ["gain = 12", 'key_file = "/a b/ü.key"']
    change_settings(path, {("radio", "gain"): None, ("mavlink", "key_file"): None})
    assert path.read_text() == default_settings_text()


@pytest.mark.parametrize(
    ("text", "change", "said"),
    [
        ("", {("radio", "kind"): "airspyy"}, "must be"),
        ("", {("radio", "gian"): 3}, "did you mean gain"),
        ("", {("antenna", "yaw_offset_deg"): 400.0}, "at most 360"),
        ("[radio]\nkind = 3\n", {("radio", "gain"): 3}, "[radio] kind is 3"),
        ('radio.kind = "rtlsdr"\n', {("radio", "kind"): "hackrf"}, "uavrt cannot change"),
        ('radio = {kind = "rtlsdr"}\n', {("radio", "kind"): "hackrf"}, "uavrt cannot change"),
        ("[radio\n", {("radio", "gain"): 3}, "not TOML"),
    ],
)
def test_what_cannot_be_written_leaves_the_file_as_it_was(
    tmp_path: Path, text: str, change: dict[tuple[str, str], object], said: str
) -> None:
    path = tmp_path / "uavrt.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r".") as refused:
        change_settings(path, change)  # type: ignore[arg-type]
    assert said in str(refused.value)
    assert refused.value.remedy
    assert path.read_text() == text


def test_a_string_over_several_lines_is_replaced_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "uavrt.toml"
    path.write_text('[radio]\nserial = """\nold\n# kind = "no"\n"""\nkind = "hackrf"\n')
    change_settings(path, {("radio", "serial"): "0x35AC"})
    assert tomllib.loads(path.read_text()) == {"radio": {"serial": "0x35AC", "kind": "hackrf"}}
