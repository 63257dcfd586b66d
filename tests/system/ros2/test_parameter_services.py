"""ROS 2's parameter services, asked by a client that speaks as Cyclone's RMW does.

The client shares no code with ours: its types are the definitions that `rosbags` has, its bytes
the DDS binding's.
"""

import threading
from typing import Any

import made
import pytest
from until import until

from uavrt.config.parameters import OFFERED, with_parameter
from uavrt.config.settings import Ros2Settings, Settings

NODE = "StartStopComponent"
SERVICES = {
    "list_parameters": "ListParameters",
    "get_parameters": "GetParameters",
    "get_parameter_types": "GetParameterTypes",
    "describe_parameters": "DescribeParameters",
    "set_parameters": "SetParameters",
    "set_parameters_atomically": "SetParametersAtomically",
}
BOOL, INTEGER, DOUBLE = 1, 2, 3
GUID = 0x1122334455667788


def idl(name: str) -> Any:
    """The binding's own type of a ROS message, by its fields as `rosbags` has them."""
    from cyclonedds.idl import make_idl_struct, types
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    made: dict[str, Any] = {}

    def one(definition: Any) -> Any:
        kind, what = definition
        if kind.name == "BASE":
            plain = {"bool": bool, "byte": types.byte, "octet": types.byte, "string": str}
            return plain.get(what[0]) or getattr(types, what[0])
        if kind.name == "NAME":
            return struct(what)
        return types.sequence[one(what[0])]

    def struct(full: str) -> Any:
        if full not in made:
            _, fields = store.fielddefs[full]
            package, _, short = full.split("/")
            made[full] = make_idl_struct(
                short, f"{package}.msg.dds_.{short}_", {n: one(d) for n, d in fields}
            )
        return made[full]

    return struct(f"rcl_interfaces/msg/{name}")


def service_types() -> dict[str, tuple[Any, Any]]:
    """Request and reply of each service, behind the header of Cyclone's RMW."""
    from cyclonedds.idl import make_idl_struct, types

    strings = types.sequence[str]
    parameters = types.sequence[idl("Parameter")]
    requests = {
        "ListParameters": {"prefixes": strings, "depth": types.uint64},
        "GetParameters": {"names": strings},
        "GetParameterTypes": {"names": strings},
        "DescribeParameters": {"names": strings},
        "SetParameters": {"parameters": parameters},
        "SetParametersAtomically": {"parameters": parameters},
    }
    replies = {
        "ListParameters": {"result": idl("ListParametersResult")},
        "GetParameters": {"values": types.sequence[idl("ParameterValue")]},
        "GetParameterTypes": {"types": types.sequence[types.uint8]},
        "DescribeParameters": {"descriptors": types.sequence[idl("ParameterDescriptor")]},
        "SetParameters": {"results": types.sequence[idl("SetParametersResult")]},
        "SetParametersAtomically": {"result": idl("SetParametersResult")},
    }
    head = {"guid": types.uint64, "sequence": types.int64}
    return {
        name: tuple(
            make_idl_struct(
                f"{name}_{part}", f"rcl_interfaces.srv.dds_.{name}_{part}_", head | body[name]
            )
            for part, body in (("Request", requests), ("Response", replies))
        )
        for name in requests
    }


class Client:
    """Asks one node's parameter services."""

    def __init__(self, peer: Any, namespace: str = "") -> None:
        from cyclonedds.core import Policy, Qos
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        qos = Qos(
            Policy.Reliability.Reliable(duration(seconds=1)),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(10),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        self._asked = 0
        self.types = service_types()
        self.ends: dict[str, tuple[Any, Any]] = {}
        for service, name in SERVICES.items():
            request, reply = self.types[name]
            place = f"{namespace}{NODE}/{service}"
            asking = Topic(peer._participant, f"rq/{place}Request", request)
            answers = Topic(peer._participant, f"rr/{place}Reply", reply)
            writer = DataWriter(peer._participant, asking, qos=qos)
            reader = DataReader(peer._participant, answers, qos=qos)
            self.ends[service] = writer, reader
        for writer, reader in self.ends.values():
            until(writer.get_matched_subscriptions)
            until(reader.get_matched_publications)

    def ask(self, service: str, **details: Any) -> Any:
        """Ask; wait for the answer to this question."""
        writer, reader = self.ends[service]
        request, _ = self.types[SERVICES[service]]
        self._asked += 1
        writer.write(request(guid=GUID, sequence=self._asked, **details))
        found: list[Any] = []

        def answered() -> bool:
            found.extend(reader.take(10))
            return bool(found)

        until(answered)
        assert (found[0].guid, found[0].sequence) == (GUID, self._asked)
        return found[0]

    def set(self, service: str, **values: bool | int | float) -> Any:
        """Set parameters by their names."""
        kinds = {bool: (BOOL, "bool_value"), int: (INTEGER, "integer_value")}
        parameters = []
        for name, value in values.items():
            number, place = kinds.get(type(value), (DOUBLE, "double_value"))
            blank = {
                "bool_value": False,
                "integer_value": 0,
                "double_value": 0.0,
                "string_value": "",
                **{f"{kind}_array_value": [] for kind in ("byte", "bool", "integer", "double")},
                "string_array_value": [],
            }
            content = idl("ParameterValue")(type=number, **(blank | {place: value}))
            parameters.append(idl("Parameter")(name=name, value=content))
        return self.ask(service, parameters=parameters)


class Supervisor:
    """Takes and refuses as the real one does; on a thread, for the client waits."""

    def __init__(self, gateway: Any, settings: Settings, refusal: str = "") -> None:
        self._gateway, self.settings, self._refusal = gateway, settings, refusal
        self.asked: list[Any] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                (command,) = self._gateway.receive("command", timeout_s=60.0)
            except (AssertionError, OSError):
                return
            self.asked.append(command)
            message = self._refusal
            if not message:
                try:
                    self.settings = with_parameter(
                        self.settings, command.parameter, command.value
                    )
                except Exception as error:  # noqa: BLE001 - said to the client
                    message = str(error)
                else:
                    self._gateway.send("settings", self.settings)
            reply = made.reply(command, message=message, accepted=not message)
            self._gateway.send("command_reply", reply)


@pytest.fixture
def settings(ros_domain: int) -> Ros2Settings:
    return Ros2Settings(enabled=True, domain_id=ros_domain, parameter_services=True)


def test_parameters_are_listed_described_and_read(
    launch: Any, ros_peer: Any, settings: Ros2Settings
) -> None:
    gateway = launch(settings)
    gateway.send("system_status", made.system_status())
    client = Client(ros_peer)
    names = client.ask("list_parameters", prefixes=[], depth=0).result.names
    assert names == list(OFFERED)
    asked = ["DET_WINDOW_HZ", "DET_K", "RADIO_BIAS_TEE", "DET_RUN", "nonsense"]
    values = client.ask("get_parameters", names=asked).values
    assert [value.type for value in values] == [DOUBLE, INTEGER, BOOL, BOOL, 0]
    assert (values[0].double_value, values[1].integer_value) == (500.0, 0)
    assert [value.bool_value for value in values] == [False, False, False, True, False]
    types = client.ask("get_parameter_types", names=asked).types
    assert list(types) == [DOUBLE, INTEGER, BOOL, BOOL, 0]
    first, second, *_ = client.ask("describe_parameters", names=asked).descriptors
    assert first.floating_point_range[0].to_value == 2000.0
    assert second.integer_range[0].to_value == 100
    assert "Pulses summed" in second.description


def test_what_is_set_goes_to_the_supervisor_and_his_answer_comes_back(
    launch: Any, ros_peer: Any, settings: Ros2Settings
) -> None:
    gateway = launch(settings)
    client = Client(ros_peer)
    supervisor = Supervisor(gateway, Settings(ros2=settings))
    results = client.set("set_parameters", DET_K=5, DET_WINDOW_HZ=5000.0, NONE=1).results
    assert [result.successful for result in results] == [True, False, False]
    assert "DET_WINDOW_HZ cannot be 5000" in results[1].reason
    assert "no parameter NONE" in results[2].reason
    assert supervisor.settings.detection.k == 5
    assert {command.source for command in supervisor.asked} == {"ros2"}
    value = client.ask("get_parameters", names=["DET_K"]).values[0]
    assert (value.type, value.integer_value) == (INTEGER, 5)


def test_together_all_are_set_or_none(
    launch: Any, ros_peer: Any, settings: Ros2Settings
) -> None:
    gateway = launch(settings)
    client = Client(ros_peer)
    supervisor = Supervisor(gateway, Settings(ros2=settings))
    answer = client.set("set_parameters_atomically", DET_K=5, DET_WINDOW_HZ=5000.0).result
    assert not answer.successful
    assert "DET_WINDOW_HZ cannot be 5000" in answer.reason
    assert supervisor.asked == []
    assert client.set("set_parameters_atomically", DET_K=5, RADIO_PPM=1).result.successful
    assert supervisor.settings.detection.k == 5
    assert supervisor.settings.radio.frequency_correction_ppm == 1.0


def test_who_does_not_command_hears_why(
    launch: Any, ros_peer: Any, settings: Ros2Settings
) -> None:
    gateway = launch(settings)
    client = Client(ros_peer)
    Supervisor(gateway, Settings(ros2=settings), refusal="mavlink 255/190 is in command")
    (result,) = client.set("set_parameters", DET_K=5).results
    assert (result.successful, result.reason) == (False, "mavlink 255/190 is in command")


def test_a_drone_that_only_shows_lists_its_parameters_and_sets_none(
    launch: Any, ros_peer: Any, ros_domain: int
) -> None:
    shown = Ros2Settings(
        enabled=True,
        domain_id=ros_domain,
        namespace="drone1",
        parameter_services=True,
        accept_commands=False,
    )
    launch(shown)
    client = Client(ros_peer, namespace="drone1/")
    assert "DET_K" in client.ask("list_parameters", prefixes=["DET_K"], depth=0).result.names
    (result,) = client.set("set_parameters", DET_K=5).results
    assert "accept_commands = false" in result.reason
