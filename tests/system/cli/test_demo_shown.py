"""What a demo shows of a program that did not start."""

import os
from pathlib import Path

import pytest

from uavrt.core.errors import UavrtError
from uavrt.simulation.demo.demo_programs import Program
from uavrt.simulation.demo.demo_run import not_started


def test_a_flight_that_does_not_start_is_told_with_the_ground_s_last_words(
    tmp_path: Path,
) -> None:
    log = tmp_path / "ground.log"
    program = Program("ground", ("uavrt.cli", "ground", "--start"), log)
    while not program.ended:
        os.sched_yield()
    error = not_started(program)
    assert "did not start: there are no tags" in str(error)
    assert str(log) in str(error)
    with pytest.raises(UavrtError, match="there are no tags") as ended:
        program.check()
    assert str(log) in str(ended.value)
