"""The world that `uavrt demo` flies in: the built-in one, or a scenario file's."""

from dataclasses import replace
from pathlib import Path

import pytest

from uavrt.core.errors import UsageError
from uavrt.simulation.demo.summary import true_bursts
from uavrt.simulation.demo.worlds import flight_world, search_world
from uavrt.simulation.scene.demo_world import demo_scenario, search_scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.scene.world import World

GIVEN = demo_scenario(60.0, 7, coded=True)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_scenario(GIVEN, tmp_path / "world.toml")
    return tmp_path / "world.toml"


def test_a_scenario_file_is_flown_as_it_is_unless_told_otherwise(file: Path) -> None:
    assert flight_world(file, duration_s=None, seed=None, coded=False) == GIVEN
    changed = flight_world(file, duration_s=25.0, seed=3, coded=False)
    assert changed == replace(GIVEN, duration_s=25.0, seed=3)
    built_in = flight_world(None, duration_s=None, seed=None, coded=True)
    assert built_in == demo_scenario(120.0, 1, coded=True)
    assert [tag.tag_id for tag in built_in.tags if tag.coded] == [12, 14]


def test_a_search_hovers_over_the_files_home(file: Path) -> None:
    world = search_world(file, limit_s=600.0, seed=None, coded=False)
    assert (world.tag, world.flight.leg) == (GIVEN.tag, ())
    assert world.duration_s > 600.0
    built_in = search_world(None, limit_s=600.0, seed=None, coded=True)
    assert built_in == search_scenario(1, coded=True)
    assert sum(tag.coded for tag in built_in.tags) == 2


def test_worlds_that_show_nothing_are_refused(file: Path) -> None:
    with pytest.raises(UsageError, match="--coded works only with the built-in world"):
        flight_world(file, duration_s=None, seed=None, coded=True)
    with pytest.raises(UsageError, match="at least 20 s"):
        flight_world(file, duration_s=5.0, seed=None, coded=False)
    far = tuple(replace(tag, north_m=400.0) for tag in GIVEN.tag)
    write_scenario(replace(GIVEN, tag=far), file)
    with pytest.raises(UsageError, match="tag 2 is 410 m from home"):
        search_world(file, limit_s=60.0, seed=None, coded=False)
    write_scenario(replace(GIVEN, tag=()), file)
    with pytest.raises(UsageError, match="no tag to search for"):
        flight_world(file, duration_s=None, seed=None, coded=False)


def test_bursts_that_were_sent_are_counted_whole() -> None:
    robin = next(tag for tag in GIVEN.tag if tag.tag_id == 12)
    begin_ns = GIVEN.start_time_ns + 430_000_000  # within its first burst
    sent = World(GIVEN).truth(begin_ns, begin_ns + 10_000_000_000)
    own = [pulse for pulse in sent if pulse.tag_id == 12]
    assert len(own) == 2 + 4 * 4
    bursts = true_bursts(own, 4)
    starts_s = [1e-9 * (one.start_time_ns - GIVEN.start_time_ns) for one in bursts]
    assert starts_s == pytest.approx([2.7, 5.0, 7.3, 9.6], abs=2e-3)
    for burst in bursts:
        length_s = 1e-9 * (burst.end_time_ns - burst.start_time_ns)
        assert length_s == pytest.approx(robin.tag.length_s, abs=1e-4)
