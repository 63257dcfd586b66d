"""What commands say to a person: numbers with their things, states by their names."""

from dataclasses import replace
from pathlib import Path

from past_flight import write_flight

from uavrt.analysis.report.report_words import health_table
from uavrt.analysis.survey import read_survey
from uavrt.cli.system.ground import _text_of
from uavrt.core.commands import SystemState
from uavrt.core.messages import Health
from uavrt.core.units import counted


def test_one_thing_is_not_told_as_several() -> None:
    assert counted(1, "flight") == "1 flight"
    assert counted(0, "flight") == "0 flights"
    assert counted(2, "battery", "batteries") == "2 batteries"


def test_states_are_told_in_words_and_an_unknown_one_as_such() -> None:
    for state in SystemState:
        said = _text_of({"event": "state", "state": state.value})
        assert said == f"the drone is {state.words}"
        assert "_" not in said
    assert _text_of({"event": "state", "state": None}) == "the drone is in an unknown state"


def test_a_report_does_not_list_which_stations_the_link_counts(tmp_path: Path) -> None:
    survey = read_survey(tmp_path / write_flight(tmp_path, 300.0, 200.0))
    health = Health(
        time_ns=1,
        process="connection",
        status="ready",
        ok=True,
        counters={"pulses_sent": 7.0, "station_silent_s_254_190": 0.2703},
    )
    _, rows = health_table(replace(survey, health=(health,)))
    assert rows == [["connection", "ready", "100 % of the time", "pulses sent 7"]]
