"""The secrets of a ground station, from their files."""

from pathlib import Path

import pytest
from some import some

from uavrt.cli.system.ground import ground
from uavrt.core.errors import ConfigError
from uavrt.ground.link.keys import NO_KEYS, read_link_keys


def test_both_keys_are_read_from_files_of_hexadecimal_digits(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text("5a" * 32)
    path.chmod(0o600)
    keys = read_link_keys(path, path)
    assert some(keys.command).secret == some(keys.signing).secret == b"Z" * 32
    assert "5a" not in repr(keys)
    assert read_link_keys(None, None) == NO_KEYS


@pytest.mark.parametrize("option", ["command_key", "signing_key"])
def test_a_key_that_is_none_is_refused_before_anything_is_opened(
    tmp_path: Path, option: str
) -> None:
    path = tmp_path / "key"
    path.write_text("no key")
    with pytest.raises(ConfigError, match="openssl rand -hex 32"):
        ground(headless=True, output=tmp_path, **{option: path})  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == [path]
