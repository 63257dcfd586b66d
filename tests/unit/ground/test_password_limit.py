"""Guesses from one address are few; those of others never delay the right password."""

import asyncio
import ipaddress
import random
from pathlib import Path
from typing import Any

import pytest

from uavrt.core.errors import ConfigError
from uavrt.ground.web.access.guard import Guard
from uavrt.ground.web.access.password_limit import (
    LEAST_PASSWORD,
    TRIES,
    WINDOW_S,
    PasswordLimit,
)
from uavrt.ground.web.page_program import PageSettings, PageStation
from uavrt.ground.web.server import ServerSettings

PASSWORD = "marmot-7"
YEAR_S = 365 * 86_400.0


class Clock:
    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def test_an_address_and_a_household_of_ipv6_have_five_guesses_a_minute() -> None:
    clock = Clock()
    guesses = PasswordLimit(clock)
    for number in range(TRIES):
        assert guesses.wait_s(f"2001:db8::{number:x}") == 0.0
        guesses.wrong(f"2001:db8::{number:x}")
    assert guesses.wait_s("2001:db8::ffff") == 60.0, "a household has many addresses"
    assert guesses.wait_s("2001:db8:0:1::1") == 0.0
    assert guesses.refused == 1
    for _ in range(TRIES):
        guesses.wrong("::ffff:192.0.2.1")
    assert guesses.wait_s("192.0.2.1") == 60.0, "the same address"
    clock.now_s += 30.0
    assert guesses.wait_s("192.0.2.1") == 30.0
    clock.now_s += 31.0
    assert guesses.wait_s("192.0.2.1") == guesses.wait_s("2001:db8::1") == 0.0


def test_no_number_of_guesses_from_elsewhere_delays_an_address() -> None:
    clock, pick = Clock(), random.Random(3)
    guesses = PasswordLimit(clock)
    for _ in range(20_000):
        guesses.wrong(str(ipaddress.IPv4Address(pick.getrandbits(32) | 1)))
        clock.now_s += 0.01
        assert guesses.wait_s("192.0.2.8") == 0.0
    assert len(guesses._wrong) <= WINDOW_S / 0.01 + 1, "older ones are forgotten"


async def asked(guard: Guard, address: str, given: str, path: str = "/api/motion/stop") -> int:
    """Status of a script's request from an address."""
    status: list[int] = []

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            status.append(message["status"])

    async def receive() -> Any:
        return {"type": "http.request", "body": b"{}"}

    scope = {
        "type": "http",
        "method": "POST",
        "path": path,
        "scheme": "http",
        "client": (address, 40_000),
        "headers": [
            (b"host", b"192.0.2.100:8650"),
            (b"content-type", b"application/json"),
            (b"authorization", f"Bearer {given}".encode()),
        ],
    }
    await guard(scope, receive, send)
    return status[0]


async def stops(_scope: Any, _receive: Any, send: Any) -> None:
    """The page's server behind the guard."""
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"{}"})


def run(main: Any) -> None:
    with pytest.raises(StopIteration):
        main.send(None)


def test_a_stop_with_the_right_password_is_served_during_other_peoples_guesses() -> None:
    async def main() -> None:
        guard = Guard(stops, password=PASSWORD)
        for number in range(3000):
            other = f"198.51.{number // 250}.{number % 250}"
            assert await asked(guard, other, f"guess{number}") == 401
            if number % 100 == 0:
                assert await asked(guard, "192.0.2.8", PASSWORD) == 200
        assert await asked(guard, "192.0.2.9", "") == 401
        for _ in range(TRIES - 1):
            assert await asked(guard, "192.0.2.9", "wrong") in (401, 429)
        assert await asked(guard, "192.0.2.9", PASSWORD) == 429, "its own guesses do"
        assert await asked(guard, "192.0.2.8", PASSWORD) == 200

    run(main())


def test_the_shortest_password_takes_years_to_guess() -> None:
    guesses_per_s = 10_000.0
    assert 36**LEAST_PASSWORD / 2 / guesses_per_s > 4.0 * YEAR_S
    assert 36**LEAST_PASSWORD / 2 / (TRIES / WINDOW_S) > 1e5 * YEAR_S


def test_a_page_with_a_short_password_does_not_start(tmp_path: Path) -> None:
    settings = PageSettings(
        directory=tmp_path,
        address="udpin://127.0.0.1:0",
        server=ServerSettings(port=0, password="marmot"),
    )
    with pytest.raises(ConfigError, match=r"has 6 characters.*8 random letters"):
        asyncio.run(PageStation(settings, lambda _: None).run())
