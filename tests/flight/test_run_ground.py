"""``uavrt run --ground``: the drone side and the page on one computer."""

import json
import secrets
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from command_line import launched
from some import some

from uavrt.flight.flight_order import flights_in_order
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.tag_table import rows_from_tags
from uavrt.simulation.scene.scenario_file import write_scenario

pytest.importorskip("starlette")


def posted(url: str, body: Any) -> urllib.request.Request:
    return urllib.request.Request(
        url, data=json.dumps(body).encode(), headers={"Content-Type": "application/json"}
    )


def asked(
    address: str, path: str, until: Callable[[Any], bool], body: dict[str, Any] | None = None
) -> Any:
    """An answer of the page's server, once it is what is waited for."""
    url, answer = f"{address}api/{path}", None
    for _ in range(300):
        try:
            with urllib.request.urlopen(
                url if body is None else posted(url, body), timeout=60
            ) as response:
                answer = json.loads(response.read())
        except OSError as error:
            answer = None
            if isinstance(error, urllib.error.HTTPError):
                error.close()  # its socket
                if error.code in (404, 405):
                    raise
        if answer is not None and until(answer):
            return answer
        time.sleep(0.1)
    raise AssertionError(f"{path} stayed {answer}")


@contextmanager
def companion(directory: Path) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    """The two run there; gives the page's address and what runs them."""
    running = launched(
        *("-m", "uavrt.cli", "run", "--ground", "--ground-port", "0", "--no-browser"),
        cwd=directory,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield some(running.stdout).readline().split()[4], running
    finally:
        if running.poll() is None:
            running.terminate()
            running.wait(60)
        some(running.stdout).close()


def test_what_the_page_receives_lies_beside_the_drones_flight_under_its_name(
    thesis_scenario: Any, tmp_path: Path
) -> None:
    scenario = thesis_scenario.starting_at(time.time_ns())
    write_scenario(scenario, tmp_path / "scenario.toml")
    radio = [sys.executable, "-m", "uavrt.simulation.airspy_rx", "--world", "scenario.toml"]
    (tmp_path / "uavrt.toml").write_text(
        f'[radio]\nprogram = {json.dumps(radio)}\n[mavlink]\naddress = ""\n'
        '[recording]\ndirectory = "flights"\n'
    )
    with companion(tmp_path) as (address, running):
        asked(address, "state", lambda one: one["drone"]["state"] == "idle")
        put = posted(f"{address}api/tags", rows_from_tags(scenario.tags))
        put.method = "PUT"
        urllib.request.urlopen(put, timeout=60).close()
        for command in ("send_tags", "start"):
            asked(address, f"commands/{command}", lambda one: one["accepted"], {})
        state = asked(address, "state", lambda one: one["drone"]["state"] == "detecting")
        copy = state["flight"]["flight_id"]
        asked(address, f"flights/{copy}", lambda one: one["pulses"] >= 2)
        running.send_signal(signal.SIGINT)
        assert running.wait(60) == 0
    own, beside = flights_in_order(tmp_path / "flights")
    assert (beside.name, own.name) == (copy, copy.removesuffix("_ground"))
    assert read_flight(own).info.tags == read_flight(beside).info.tags


def test_the_page_of_the_companion_finds_its_drone_side_and_ends_with_it(
    tmp_path: Path,
) -> None:
    # A drone that takes only what is sealed and signed: the page has the keys from it.
    for name in ("command.key", "signing.key"):
        (tmp_path / name).write_text(secrets.token_hex(32))
        (tmp_path / name).chmod(0o600)
    (tmp_path / "uavrt.toml").write_text(
        '[mavlink]\naddress = ""\nkey_file = "command.key"\n'
        'signing_key_file = "signing.key"\n[recording]\ndirectory = "flights"\n'
    )
    with companion(tmp_path) as (address, running):
        state = asked(address, "state", lambda one: one["drone"]["state"] == "idle")
        assert state["connection"]["address"].startswith("udpout://127.0.0.1:")
        assert asked(address, "drone/flights", lambda one: isinstance(one, list), {}) == []
        wish = posted(f"{address}api/commands/set_parameter", {"name": "DET_K", "value": 4})
        with urllib.request.urlopen(wish, timeout=60) as response:
            assert json.loads(response.read())["accepted"]
        running.send_signal(signal.SIGTERM)
        assert running.wait(60) == 0
        with pytest.raises(OSError, match="refused"):
            urllib.request.urlopen(f"{address}api/state", timeout=5)
