"""A session that ends while its links are opened leaves no task and no socket behind."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from until import until_async as until

from uavrt.core.clock import Clock
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.requests import parallel_links
from uavrt.ground.session import GroundSession
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.link.mavlink.links.mavlink_link import Link
from uavrt.link.mavlink.links.transport import open_link


async def test_a_session_that_ends_while_its_link_opens_ends_the_link(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []

    async def run(*_: object) -> None:
        steps.append("opening")
        try:
            await asyncio.sleep(3600.0)
        finally:
            steps.append("ended")

    monkeypatch.setattr(GroundLink, "run", run)
    store = GroundStore(tmp_path / "ground")
    store.settings = replace(store.settings, address="udpin://127.0.0.1:9")
    session = asyncio.create_task(GroundSession(store, Clock.start()).run())
    await until(lambda: steps)
    session.cancel()
    await asyncio.gather(session, return_exceptions=True)
    assert steps == ["opening", "ended"]


async def test_the_first_link_is_closed_if_the_second_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened: list[Link] = []

    async def slow(address: str, *rest: Any) -> Link:
        if opened:
            await asyncio.sleep(3600.0)
        opened.append(await open_link(address, *rest))
        return opened[-1]

    monkeypatch.setattr(parallel_links, "open_link", slow)
    link = GroundLink(Clock.start().now_ns)
    running = asyncio.create_task(link.run("udpin://127.0.0.1:0", "udpin://127.0.0.1:0"))
    await until(lambda: opened)
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert vars(opened[0])["_closed"]
