"""A unit test that waits or starts a program fails; one that waits in asyncio costs no time."""

import os
import re
import shutil
import time
from pathlib import Path

import pytest
from command_line import python

TESTS = Path(__file__).parents[1]
TRIED = """
import asyncio
import multiprocessing
import os
import subprocess
import sys
import time

import pytest


@pytest.fixture(scope="module")
def slept():
    time.sleep(0.001)


@pytest.fixture(scope="module")
def waited():
    asyncio.run(asyncio.sleep(3600))


def test_fixture_of_a_module(slept):
    pass


def test_hour_of_a_module(waited):
    pass


def test_sleep():
    time.sleep(0.001)


def test_sleep_that_nobody_hears_of():
    try:
        time.sleep(0.001)
    except Exception:
        pass


def test_program():
    subprocess.run([sys.executable, "-c", ""])


def test_shell():
    os.system("true")


def test_fork():
    if not os.fork():
        os._exit(0)


def test_worker():
    multiprocessing.get_context("spawn").Process(target=print).start()


def test_hour():
    asyncio.run(asyncio.sleep(3600))


def test_sum():
    assert sum(range(4)) == 6
"""
REFUSED = {"sleep", "sleep_that_nobody_hears_of", "program", "shell", "fork", "worker"}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What becomes of each test beside the conftest of `tests/unit`."""
    folder = tmp_path_factory.mktemp("unit")
    shutil.copy(TESTS / "unit" / "conftest.py", folder)
    (folder / "test_tried.py").write_text(TRIED)
    begun_s = time.monotonic()
    done = python(
        *("-m", "pytest", "-v", "-p", "no:cacheprovider", folder),
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(TESTS / "drivers")},
    )
    found = dict(re.findall(r"::test_(\w+) (PASSED|FAILED|ERROR)", done.stdout))
    assert time.monotonic() - begun_s < 600.0, "an hour was waited for"
    assert len(found) == TRIED.count("def test_"), done.stdout + done.stderr
    return found


def test_waiting_and_starting_programs_are_refused(outcomes: dict[str, str]) -> None:
    assert {name for name, outcome in outcomes.items() if outcome == "FAILED"} == REFUSED
    assert outcomes["fixture_of_a_module"] == "ERROR"


def test_computing_and_an_hour_of_virtual_time_pass(outcomes: dict[str, str]) -> None:
    assert {name for name, word in outcomes.items() if word == "PASSED"} == {
        "hour",
        "hour_of_a_module",
        "sum",
    }
