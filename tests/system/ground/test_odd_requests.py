"""Odd files and names spoil no answer of the page's server."""

import pytest
from sql import write_mbtiles
from tests.system.ground.conftest import Served


def test_a_map_without_a_credit_and_edges_does_not_empty_the_set_up_page(
    served: Served,
) -> None:
    place = served.directory / "maps" / "odd.mbtiles"
    facts = dict.fromkeys(("attribution", "bounds", "format"))
    write_mbtiles(place, facts, [(1, 0, 0, b"\x89PNG")])
    answer = served.ask("GET", "/api/choices")
    assert answer.status == 200
    assert answer.json["maps"][0]["bounds"] == [-180.0, -85.0, 180.0, 85.0]


@pytest.mark.parametrize("what", ["", "/pulses", "/columns", "/track", "/report", "/folds"])
def test_a_flight_of_300_letters_is_not_found_and_no_fault_of_the_server(
    standing: Served, what: str
) -> None:
    answer = standing.ask("GET", f"/api/flights/{'a' * 300}{what}")
    assert answer.status == 404
    assert answer.json["error"].startswith("there is no flight")


def test_a_folder_name_that_no_disk_takes_is_refused_in_words(standing: Served) -> None:
    for name in ("dem", "archive"):
        answer = standing.ask("PUT", "/api/settings", {name: "/" + "b" * 5000})
        assert answer.status == 422
        assert answer.json["error"]
