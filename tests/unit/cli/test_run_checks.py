"""What ``uavrt run`` finds wrong with the link before anything flies."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from uavrt.cli.system.run import check_link, without_autopilot
from uavrt.config.settings import MavlinkSettings, PoseSettings, Settings
from uavrt.core.errors import ConfigError


def settings(**mavlink: Any) -> Settings:
    return replace(Settings(), mavlink=MavlinkSettings(**mavlink))


@pytest.mark.parametrize(
    ("mavlink", "words"),
    [
        ({"address": "udp:14540"}, "not a link address"),
        ({"key_file": "/nowhere/key"}, "cannot read the key file"),
        ({"signing_key_file": "/nowhere/key"}, "cannot read the signing key"),
    ],
)
def test_a_link_that_cannot_begin_is_refused_on_the_ground(
    mavlink: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        check_link(settings(**mavlink))
    assert caught.value.remedy


def test_a_link_with_both_keys_and_an_experimental_generation_may_begin(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text("5a" * 32)
    key.chmod(0o600)
    keys = {"key_file": str(key), "signing_key_file": str(key), "tunnel_generation": "G2"}
    check_link(settings(**keys, tunnel_experimental=True))
    with pytest.raises(ConfigError, match="is experimental"):
        check_link(settings(**keys))


def test_a_mast_needs_no_autopilot_and_refuses_a_second_pose() -> None:
    mast = PoseSettings(source="fixed", latitude_deg=46.5, longitude_deg=8.0, heading_deg=0.0)
    alone = without_autopilot(replace(Settings(), pose=mast))
    assert alone.mavlink.address == ""
    both = replace(settings(address="tcp://127.0.0.1:5760"), pose=mast)
    with pytest.raises(ConfigError, match="both set the pose"):
        without_autopilot(both)
    with pytest.raises(ConfigError, match="heading_deg"):
        without_autopilot(replace(Settings(), pose=replace(mast, heading_deg=None)))
    assert without_autopilot(Settings()) == Settings()
