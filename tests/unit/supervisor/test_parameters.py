"""Parameters that an operator sets: in force, kept, refused."""

from pathlib import Path

from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.messages import Command, CommandReply, FlightInfo, SystemState, Tag
from uavrt.supervisor.kept import PARAMETERS_NAME
from uavrt.supervisor.memory import StateStore
from uavrt.supervisor.mission import Mission

TAG = Tag(tag_id=2, frequency_hz=148_710_000.0, pulse_width_s=0.02, pulse_intervals_s=(1.254,))


class Operator:
    """Commands a mission as a freshly started supervisor has it."""

    def __init__(self, directory: Path, radio: RadioSettings) -> None:
        self.flights: list[FlightInfo] = []
        self.changes: list[Settings] = []
        self.mission = Mission(
            Settings(recording=RecordingSettings(directory=str(directory)), radio=radio),
            StateStore(directory),
            tell=lambda _severity, _text: None,
            on_start=self.flights.append,
            on_stop=lambda: None,
            on_settings=self.changes.append,
        )
        self._number = 0

    def say(self, name: str, **details: object) -> CommandReply:
        self._number += 1
        command = Command(name=name, request_id=self._number, **details)  # type: ignore[arg-type]
        return self.mission.command(command)

    def set(self, name: str, value: float) -> CommandReply:
        return self.say("set_parameter", parameter=name, value=value)


RADIO = RadioSettings(center_frequency_hz=148.7e6)


def test_k_that_is_set_in_flight_waits_for_the_next_start(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    operator.say("start_tags")
    operator.say("add_tag", tag=TAG)
    operator.say("end_tags")
    operator.say("start_detection")
    reply = operator.set("DET_K", 5)
    assert (reply.accepted, reply.message) == (True, "DET_K = 5, from the next start")
    assert operator.set("RADIO_GAIN", 10).message == "RADIO_GAIN = 10"
    assert operator.flights[-1].tags[0].k == 3
    assert operator.mission.state is SystemState.DETECTING
    operator.say("stop_detection")
    operator.mission.flight_ended()
    operator.say("start_detection")
    assert operator.flights[-1].tags[0].k == 5
    assert operator.mission.tags[2].k == 3
    assert [change.detection.k for change in operator.changes] == [5, 5]


def test_a_parameter_outlives_the_supervisor_until_the_file_says_otherwise(
    tmp_path: Path,
) -> None:
    assert Operator(tmp_path, RADIO).set("RADIO_GAIN", 12).accepted
    assert Operator(tmp_path, RADIO).mission.settings.radio.gain == 12
    edited = RadioSettings(center_frequency_hz=148.7e6, gain=18)
    assert Operator(tmp_path, edited).mission.settings.radio.gain == 18


def test_a_parameter_set_back_to_the_file_is_forgotten(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    operator.set("RADIO_GAIN", 12)
    operator.set("RADIO_GAIN", -1)
    assert (tmp_path / PARAMETERS_NAME).read_text().strip() == "{}"


def test_a_damaged_file_of_parameters_costs_only_them(tmp_path: Path) -> None:
    (tmp_path / PARAMETERS_NAME).write_text('{"RADIO_GAIN": 3')
    assert Operator(tmp_path, RADIO).mission.settings.radio.gain is None
    (tmp_path / PARAMETERS_NAME).write_text('{"RADIO_GAIN": {"value": 99, "instead_of": -1}}')
    assert Operator(tmp_path, RADIO).mission.settings.radio.gain is None


def test_an_impossible_value_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    for name, value in (("RADIO_GAIN", 22), ("DET_FALSE_ALARM", 1.0), ("NOTHING", 1.0)):
        reply = operator.set(name, value)
        assert not reply.accepted
        assert name in reply.message
    assert not operator.say("set_parameter").accepted
    assert operator.changes == []
    assert not (tmp_path / PARAMETERS_NAME).exists()


def test_a_start_with_an_impossible_gain_is_refused_with_the_range(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    operator.say("start_tags")
    operator.say("add_tag", tag=TAG)
    operator.say("end_tags")
    reply = operator.say("start_detection", gain=40)
    assert not reply.accepted
    assert "0 to 21" in reply.message
    assert operator.mission.state is SystemState.HAS_TAGS
