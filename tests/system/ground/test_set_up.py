"""The first set-up of a drone's computer, by the requests that its page makes."""

import errno
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from command_line import program
from willing_drone import WillingDrone

from uavrt.cli.system.ground import ground
from uavrt.config.loader import load_settings, write_default_settings
from uavrt.core.errors import ConfigError, UavrtError
from uavrt.drone.card import Card
from uavrt.drone.computer import computer_checks as checks
from uavrt.drone.computer.first_setup import FirstSetup
from uavrt.link.tunnel.own_messages.seal import read_key
from uavrt.simulation.demo.demo_programs import free_udp_port

GOOD: dict[str, dict[str, Any]] = {
    "name": {"name": "lynx-1"},
    "antenna": {"antenna": "RA-2A", "yaw_offset_deg": "90"},
    "radio": {"kind": "rtlsdr", "gain": "20", "sample_rate_msps": "0,25", "bias_tee": True},
    "autopilot": {"address": "serial:///dev/ttyAMA0:921600"},
    "keys": {"page_password": "marmot-2026", "wifi_password": "", "command_key": "new"},
}
WRONG: list[tuple[str, dict[str, Any], str]] = [
    *[("name", {"name": name}, "name") for name in ("", "Lynx", "-a", "a" * 33, "a\nb", "a;b")],
    ("name", {"name": 7}, "name"),
    ("antenna", {"antenna": "RA-99", "yaw_offset_deg": 0}, "antenna"),
    ("antenna", {"antenna": "RA-2A", "yaw_offset_deg": "361"}, "yaw_offset_deg"),
    ("antenna", {"antenna": "RA-2A", "yaw_offset_deg": "nan"}, "yaw_offset_deg"),
    ("antenna", {"antenna": "RA-2A", "yaw_offset_deg": True}, "yaw_offset_deg"),
    ("radio", GOOD["radio"] | {"kind": "airspyy"}, "kind"),
    ("radio", GOOD["radio"] | {"gain": "51"}, "gain"),
    ("radio", GOOD["radio"] | {"gain": "2.5"}, "gain"),
    ("radio", GOOD["radio"] | {"gain": "inf"}, "gain"),
    ("radio", GOOD["radio"] | {"sample_rate_msps": "3.3"}, "sample_rate_msps"),
    ("autopilot", {"address": "/dev/ttyUSB0"}, "address"),
    ("keys", {"page_password": "short"}, "page_password"),
    ("keys", {"wifi_password": "with space in it"}, "wifi_password"),
    ("keys", {"wifi_password": "x\npsk=known-by-all"}, "wifi_password"),
    ("keys", {"command_key": "abc"}, "command_key"),
    ("keys", {"update_key": "-----BEGIN PRIVATE KEY-----"}, "update_key"),
]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "drone/uavrt.toml"
    path.parent.mkdir()
    write_default_settings(path)
    return path


@pytest.fixture
def asked(serve: Callable[..., Any], config: Path, tmp_path: Path) -> Any:
    return serve(tmp_path / "ground", drone_settings=config)


def public_key(tmp_path: Path, kind: str = "ed25519") -> str:
    secret = tmp_path / f"{kind}.pem"
    made = ["openssl", "genpkey", "-algorithm", kind, "-out", str(secret)]
    subprocess.run(made, check=True, capture_output=True)
    shown = ["openssl", "pkey", "-in", str(secret), "-pubout"]
    return program(*shown, check=True).stdout


def test_each_step_is_written_and_the_end_is_kept(
    asked: Any, config: Path, tmp_path: Path
) -> None:
    begun = asked.ask("GET", "/api/set-up").json
    assert begun["wanted"]
    assert "RA-23K" in begun["choices"]["antennas"]
    assert {row["kind"] for row in begun["choices"]["radios"]} >= {"airspy", "rtlsdr"}
    early = asked.ask("POST", "/api/set-up/finish", {})
    assert (early.status, early.json["error"][:24]) == (422, "the set-up step name has")
    pem = public_key(tmp_path)
    for step, values in GOOD.items():
        more = {"update_key": pem.replace("\n", "\r\n")} if step == "keys" else {}
        assert asked.ask("PUT", f"/api/set-up/{step}", values | more).status == 200
    settings = load_settings(config)
    assert settings.bearings.antenna == "RA-2A"
    assert settings.antenna.yaw_offset_deg == 90.0
    assert (settings.radio.kind, settings.radio.gain) == ("rtlsdr", 20)
    assert (settings.radio.sample_rate_hz, settings.radio.bias_tee) == (250_000.0, True)
    assert settings.mavlink.address == "serial:///dev/ttyAMA0:921600"
    assert settings.mavlink.key_file is not None
    assert len(read_key(settings.mavlink.key_file).secret) == 32
    laptop = asked.ask("GET", "/api/set-up/command.key")
    assert laptop.body.decode().strip() == read_key(settings.mavlink.key_file).secret.hex()
    # What root takes over at the next start; nobody else reads the password meanwhile.
    handed = config.parent / "set-up.conf"
    assert handed.read_text() == "name=lynx-1\npage_password=marmot-2026\n"
    assert handed.stat().st_mode & 0o777 == 0o600
    assert (config.parent / "update-keys.pem").read_text() == pem
    assert "marmot-2026" not in str(asked.ask("GET", "/api/set-up").json)
    assert asked.ask("POST", "/api/set-up/finish", {}).json == {"name": "lynx-1"}
    assert asked.ask("GET", "/api/set-up").json == {"wanted": False}
    own = asked.ask("GET", "/api/settings").json
    assert (own["vehicle_name"], own["antenna"]) == ("lynx-1", "RA-2A")
    # Once only: then who sees the page cannot change what the drone obeys.
    for method, path in (
        ("PUT", "name"),
        ("POST", "radio/test"),
        ("GET", "command.key"),
        ("POST", "finish"),
    ):
        late = asked.ask(method, f"/api/set-up/{path}", None if method == "GET" else {})
        assert late.status == 422, path
        assert "is already set up" in late.json["error"]
    assert not FirstSetup(config).wanted


@pytest.mark.parametrize(("step", "values", "field"), WRONG)
def test_a_step_with_a_fault_names_its_field_and_writes_nothing(
    config: Path, step: str, values: dict[str, Any], field: str
) -> None:
    before = config.read_text()
    setup = FirstSetup(config)
    assert [fault.field for fault in setup.save_step(step, values)] == [field]
    assert [path.name for path in config.parent.iterdir()] == ["uavrt.toml"]
    assert config.read_text() == before
    assert step not in setup.done


def test_a_key_that_cannot_sign_updates_is_refused(config: Path, tmp_path: Path) -> None:
    setup = FirstSetup(config)
    for pem in (public_key(tmp_path, "x25519"), public_key(tmp_path) + "more\n"):
        assert [one.field for one in setup.save_step("keys", {"update_key": pem})] == [
            "update_key"
        ]


def test_the_link_is_tried_and_says_what_to_do(
    asked: Any, config: Path, tmp_path: Path
) -> None:
    port = free_udp_port()
    address = f"udpin://127.0.0.1:{port}"
    assert asked.ask("PUT", "/api/set-up/autopilot", {"address": address}).status == 200
    silent = asked.ask("POST", "/api/set-up/autopilot/test", {}).json
    assert [(one["what"], one["ok"]) for one in silent] == [("autopilot", False)]
    assert silent[0]["remedy"]
    drone = WillingDrone(port)
    heard = asked.ask("POST", "/api/set-up/autopilot/test", {}).json
    drone.close()
    assert [(one["what"], one["ok"]) for one in heard] == [("autopilot", True)]
    missing = tmp_path / "ttyUSB7"
    asked.ask("PUT", "/api/set-up/autopilot", {"address": f"serial://{missing}:57600"})
    closed = asked.ask("POST", "/api/set-up/autopilot/test", {}).json
    assert [(one["what"], one["ok"]) for one in closed] == [("permissions", False)]
    assert str(missing) in closed[0]["text"]


def test_the_drones_own_page_tells_of_its_card(
    asked: Any, config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def card() -> Any:
        found = asked.ask("GET", "/api/first-flight").json
        return {one["what"]: one for one in found}["card"]

    assert card()["ok"]
    seen: list[Path] = []

    def worn(directory: Path) -> Card:
        seen.append(directory)
        return Card(
            device="/dev/mmcblk0p3",
            kind="ext4",
            read_only=True,
            errors=2,
            written_gb=900.0,
            life_used_tenths=10,
        )

    monkeypatch.setattr(checks, "card_of", worn)
    told = card()
    assert not told["ok"]
    assert "read-only" in told["text"]
    assert "new card" in told["remedy"]
    assert seen == [config.parent]  # of the flights, wherever the page was started


def test_the_page_of_a_laptop_asks_for_nothing(served: Any) -> None:
    assert "card" not in {one["what"] for one in served.ask("GET", "/api/first-flight").json}
    assert served.ask("GET", "/api/set-up").json == {"wanted": False}
    assert served.ask("PUT", "/api/set-up/name", {"name": "lynx"}).status == 404


@pytest.mark.parametrize(("step", "values"), GOOD.items())
def test_a_card_that_takes_nothing_is_named(
    config: Path, monkeypatch: pytest.MonkeyPatch, step: str, values: dict[str, Any]
) -> None:
    def full(*_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    setup = FirstSetup(config)
    monkeypatch.setattr(os, "fsync", full)
    before = config.read_text()
    with pytest.raises(ConfigError, match=r"No space left .*uavrt doctor"):
        setup.save_step(step, values)
    assert step not in setup.done
    assert config.read_text() == before


def test_a_page_without_the_drones_settings_does_not_start(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"settings file .*install\.sh"):
        ground(set_up=tmp_path / "uavrt.toml", page=True, browser=False)


def test_strange_requests_are_refused(config: Path) -> None:
    setup = FirstSetup(config)
    with pytest.raises(UavrtError):
        setup.save_step("nest", {})
    with pytest.raises(UavrtError):
        setup.test("keys", None)
