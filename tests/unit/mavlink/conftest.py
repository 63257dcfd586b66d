"""Worlds for the tests of links."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from uavrt.core.messages import Tag
from world import THESIS_TAG, World


@pytest.fixture
def make_world(tmp_path: Path) -> Callable[..., World]:
    return partial(World, tmp_path)


@pytest.fixture
def world(make_world: Callable[..., World]) -> World:
    return make_world()


@pytest.fixture
def thesis_tag() -> Tag:
    return THESIS_TAG
