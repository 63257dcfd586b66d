"""Keys and certificates that cannot be used are refused at the start, and wait for nobody."""

import os
from pathlib import Path

import pytest
from foreign_files import certificate, encrypted

from uavrt.core.errors import ConfigError, FormatError
from uavrt.ground.link.keys import read_link_keys
from uavrt.ground.web.server import ServerSettings, listening_socket


def open_page(directory: Path) -> None:
    pair = directory / "page.pem", directory / "page.key"
    listening_socket(ServerSettings(port=0, certificate=pair[0], key=pair[1])).close()


def test_a_key_with_a_pass_phrase_says_how_to_write_it_without(tmp_path: Path) -> None:
    pem, key = certificate()
    (tmp_path / "page.pem").write_bytes(pem)
    (tmp_path / "page.key").write_bytes(key)
    open_page(tmp_path)
    encrypted(tmp_path / "page.key")
    with pytest.raises(ConfigError, match=r"protected by a pass phrase.*openssl pkey"):
        open_page(tmp_path)
    (tmp_path / "page.key").unlink()
    with pytest.raises(ConfigError, match=r"page\.key cannot be read"):
        open_page(tmp_path)


def test_pipes_in_place_of_keys_are_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "page.pem"
    os.mkfifo(pipe)
    with pytest.raises(FormatError, match="not a plain file"):
        open_page(tmp_path)
    with pytest.raises(FormatError, match="not a plain file"):
        read_link_keys(pipe, None)
