"""State of the original system's three components, derived from the state of uavrt's processes.

The radio's program and the channelizer are one process here, the receiver; a detector process
serves several tags. Each component reports its own parts: the radio by its kind and serial
number, the receiver, and each tag.
"""

from collections.abc import Iterator

from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import ProcessStatus, SystemStatus
from uavrt.link.ros2.ros_records import key_values
from uavrt.link.ros2.types.ros_messages import (
    ERROR,
    OK,
    STALE,
    WARN,
    DiagnosticStatus,
    KeyValue,
)

STALE_AFTER_S = 3.0
"""Age above which the supervisor's state, sent once a second, is stale [s]."""


def component_status(
    component: str, status: SystemStatus | None, age_s: float, settings: Settings
) -> tuple[DiagnosticStatus, ...]:
    """State of a component by a report `age_s` old; empty while nothing is meant to run."""
    if status is None or status.state is not SystemState.DETECTING:
        return ()
    stale = age_s > STALE_AFTER_S
    return tuple(
        DiagnosticStatus(
            level=STALE if stale else _level(component, process),
            name=f"{component}_component",
            message="stale" if stale else _word(component, process),
            hardware_id=hardware_id,
            values=_values(component, process, status),
        )
        for hardware_id, process in _parts(component, status, settings)
    )


def detector_of_tag(status: SystemStatus) -> dict[int, ProcessStatus]:
    """Process that detects each tag's pulses, by the supervisor's report."""
    return {tag_id: process for process in status.processes for tag_id in process.tag_ids}


def _parts(
    component: str, status: SystemStatus, settings: Settings
) -> Iterator[tuple[str, ProcessStatus | None]]:
    """Yield each part of a component, with the process that does its work."""
    processes = {process.process: process for process in status.processes}
    receiver = processes.get("receiver")
    match component:
        case "airspy_csdr_netcat":
            serial = settings.radio.serial
            kind = settings.radio.kind
            yield f"{kind} {serial}" if serial else kind, receiver
        case "channelizer":
            yield "receiver", receiver
        case _:
            detectors = detector_of_tag(status)
            for tag in status.tags:
                yield f"tag_id_{tag.tag_id}", detectors.get(tag.tag_id)


def _level(component: str, process: ProcessStatus | None) -> int:
    if process is None or not process.running:
        return ERROR
    if process.ok:
        return OK
    # The receiver runs without a radio: report it as the radio's error.
    return ERROR if component == "airspy_csdr_netcat" else WARN


def _word(component: str, process: ProcessStatus | None) -> str:
    return "dead" if _level(component, process) == ERROR else "alive"


def _values(
    component: str, process: ProcessStatus | None, status: SystemStatus
) -> tuple[KeyValue, ...]:
    if process is None:
        return ()
    values: dict[str, object] = {
        "process": process.process,
        "status": process.status,
        "restarts": process.restarts,
    }
    if process.pid is not None:
        values["pid"] = process.pid
    if component != "detector" and status.center_frequency_hz is not None:
        values["center_frequency"] = f"{status.center_frequency_hz / 1e6:.6f}"
    return key_values(values)
