"""Ways in: the radio's ports by the names of each system, and https."""

import http.client
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from command_line import program
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from uavrt.link.mavlink.links.address import parse_address


def port(device: str, description: str) -> ListPortInfo:
    info = ListPortInfo(device, True)
    info.description = description
    return info


def test_the_ports_of_every_system_are_offered_as_addresses(
    served: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = [
        port("COM12", "USB Serial Port (COM12)"),
        port("/dev/cu.usbserial-A50285BI", "FT231X USB UART"),
        port("/dev/ttyUSB0", "n/a"),
    ]
    monkeypatch.setattr(list_ports, "comports", lambda: there)
    ports = served.ask("GET", "/api/choices").json["ports"]
    assert {one["device"] for one in ports} == {one.device for one in there}
    for one in ports:
        address = parse_address(one["address"])
        assert (address.device, address.baud) == (one["device"], 57_600)
    words = {one["device"]: one["description"] for one in ports}
    assert words["COM12"] == "USB Serial Port (COM12)"
    assert words["/dev/ttyUSB0"] == ""


def test_with_a_certificate_the_page_is_served_by_https_alone(
    serve: Callable[..., Any], tmp_path: Path
) -> None:
    certificate, key = tmp_path / "ground.pem", tmp_path / "ground.key"
    program(
        *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"),
        *("-nodes", "-days", "2", "-subj", "/CN=localhost"),
        *("-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out", certificate),
        check=True,
    )
    station = serve(tmp_path / "ground", certificate=certificate, key=key, password="marmot-7")
    trusted = ssl.create_default_context(cafile=str(certificate))
    connection = http.client.HTTPSConnection(
        "127.0.0.1", station.port, timeout=20, context=trusted
    )
    headers = {"Content-Type": "application/x-www-form-urlencoded"}
    connection.request("POST", "/login", b"password=marmot-7", headers)
    answer = connection.getresponse()
    cookie = answer.getheader("Set-Cookie") or ""
    assert answer.status == 303
    # Over https the browser must never send it in the clear.
    assert {"Secure", "HttpOnly"} <= set(cookie.replace(" ", "").split(";"))
    connection.close()
    with pytest.raises((http.client.HTTPException, OSError)):
        station.ask("GET", "/api/state")
