"""Stations that last for the tests of a file, and a processor of which pages tell."""

from collections.abc import Iterator

import pytest
from page_driver import Scene
from playwright.sync_api import Browser

from uavrt.drone.processes.connection_parts import ground_status


@pytest.fixture(scope="module", autouse=True)
def processor_has_51_degrees(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    zone = tmp_path_factory.mktemp("processor") / "thermal_zone"
    zone.write_text("51500\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ground_status, "THERMAL_ZONE", zone)
        yield


@pytest.fixture(scope="module")
def lasting(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Scene]:
    """A station for all tests of a file that do not need a fresh one."""
    made = Scene(tmp_path_factory.mktemp("lasting"), browser)
    yield made
    made.close()


@pytest.fixture
def station(lasting: Scene) -> Iterator[Scene]:
    """The lasting station; pages that a test opens close with it."""
    yield lasting
    lasting.close_pages()
