"""A flight of the drone gets its tags' names from the ground station's list near it."""

from dataclasses import replace
from pathlib import Path

import pytest
from past_flight import TAG, write_flight
from sql import sql

from uavrt.config.tags.tag_files import write_tags
from uavrt.flight.reading.flight_reader import read_flight


@pytest.fixture
def nameless(tmp_path: Path) -> Path:
    """As the drone records it: the tag's message has no name."""
    flight = tmp_path / "flights" / write_flight(tmp_path / "flights", 300.0, 200.0)
    sql(flight, "UPDATE tags SET name = NULL")
    (tmp_path / "flights" / "tags.toml").unlink(missing_ok=True)
    return flight


@pytest.mark.parametrize("place", [".", "ground"])
def test_names_come_from_the_list_beside_the_flight_or_in_the_ground_s_directory(
    nameless: Path, place: str
) -> None:
    assert [tag.name for tag in read_flight(nameless).info.tags] == [None]
    (nameless.parent / place).mkdir(exist_ok=True)
    write_tags(nameless.parent / place / "tags.toml", [replace(TAG, name="badger")])
    assert [tag.name for tag in read_flight(nameless).info.tags] == ["badger"]


def test_a_list_that_has_given_the_number_to_another_tag_names_nothing(nameless: Path) -> None:
    another = replace(TAG, name="otter", frequency_hz=TAG.frequency_hz + 20e3)
    write_tags(nameless.parent / "tags.toml", [another])
    assert [tag.name for tag in read_flight(nameless).info.tags] == [None]


def test_a_damaged_list_hides_no_flight(nameless: Path) -> None:
    (nameless.parent / "tags.toml").write_text("[[tag")
    assert [tag.name for tag in read_flight(nameless).info.tags] == [None]
