"""The table of processes, which defines the drone side.

One row is one process. Start order, stop order (reverse), routing of records, silence limits
and budgets derive from it. Consumers precede their producers, so that they run first. Modules
are named by string; the table imports none of them.
"""

from collections.abc import Callable
from dataclasses import dataclass

from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.drone.supervisor.start.restarts import FLIGHT_RESTARTS, RestartPolicy

Predicate = Callable[[SystemState], bool]


def always(state: SystemState) -> bool:
    """Return True: the process runs in every state."""
    return state in SystemState


def while_detecting(state: SystemState) -> bool:
    """True for the state in which tags are searched."""
    return state is SystemState.DETECTING


def while_receiving(state: SystemState) -> bool:
    """True for the states that need the radio: detection and raw capture."""
    return state in (SystemState.DETECTING, SystemState.CAPTURING)


def on_every_drone(settings: Settings) -> bool:
    """Return True: every drone needs the process, with any settings."""
    return isinstance(settings, Settings)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessRow:
    """One row of the process table: what a process runs, receives, sends and may use."""

    name: str
    module: str
    meaning: str
    runs: Predicate
    consumes: tuple[str, ...]
    """Topics that the supervisor forwards to the process of this row."""
    produces: tuple[str, ...]
    configured: Callable[[Settings], bool] = on_every_drone
    """Function that returns True if the settings need this process."""
    backlog: int | None = None
    """Most records of one topic that are queued for the process; None for no limit. A burst
    must fit: a hundred tags with simultaneous pulses cause hundreds of records."""
    acknowledges_records: bool = False
    """True if the process acknowledges records. Those not acknowledged are sent again after a
    restart."""
    per_worker: bool = False
    """True if there is one process of this row for each detector worker."""
    samples_to: str | None = None
    """Name of the row whose processes receive samples from this process; None if none do."""
    silence_limit_s: float = 5.0
    """Silence after which the process is killed [s]; it should report once a second."""
    start_limit_s: float = 20.0
    """Longest time from the start to the first report [s], including imports."""
    restart: RestartPolicy = FLIGHT_RESTARTS
    """When the process is restarted after an unexpected end."""
    cpu_budget_percent: float
    """CPU time allowed with 100 tags [% of a core of the reference machine]."""
    memory_limit_mb: float
    stop_timeout_s: float = 5.0
    """Time from SIGTERM after which the process gets SIGKILL [s]."""


PROCESSES: tuple[ProcessRow, ...] = (
    ProcessRow(
        name="recorder",
        module="uavrt.drone.processes.recorder",
        meaning="writes the flight directory; adds poses that the connection did not supply",
        runs=always,
        consumes=(
            "pulse",
            "beep",
            "search_report",
            "search_note",
            "pulse_pose",
            "delivered",
            "poses",
            "flight",
            "flight_end",
            "corrected_tags",
            "command",
            "command_reply",
            "status_text",
            "health",
        ),
        produces=("pulse_pose", "recorded", "records_handled", "health", "status_text"),
        acknowledges_records=True,
        cpu_budget_percent=2.0,
        memory_limit_mb=60.0,
        # A memory card may need seconds for an fsync; killing the writer would not help.
        silence_limit_s=8.0,
    ),
    ProcessRow(
        name="connection",
        module="uavrt.drone.processes.connection",
        meaning="links autopilot and ground stations by MAVLink; adds its pose to each pulse",
        runs=always,
        consumes=(
            "pulse",
            "pulse_pose",
            "recorded",
            "bearing",
            "beep",
            "search_report",
            "command_reply",
            "operation",
            "settings",
            "status_text",
            "system_status",
            "flight",
            "flight_end",
            "corrected_tags",
            "motion_offer",
            "vehicle_request",
            "course",
        ),
        produces=(
            "pulse_pose",
            "delivered",
            "poses",
            "command",
            "motion",
            "vehicle",
            "vehicle_fence",
            "neighbour",
            "health",
            "status_text",
        ),
        cpu_budget_percent=6.0,
        memory_limit_mb=60.0,
    ),
    ProcessRow(
        name="estimator",
        module="uavrt.drone.processes.estimator",
        meaning="computes bearings on the drone; otherwise only the ground does",
        runs=always,
        configured=lambda settings: settings.bearings.on_drone,
        consumes=("pulse_pose", "poses", "flight", "health"),
        produces=("bearing", "health", "status_text"),
        backlog=500,
        cpu_budget_percent=10.0,
        memory_limit_mb=120.0,
    ),
    ProcessRow(
        name="integrator",
        module="uavrt.analysis.integrated.integrator",
        meaning="finds tags below the noise from the whole flight so far",
        runs=always,
        configured=lambda settings: (
            settings.integration.on_drone and settings.recording.channels
        ),
        consumes=("flight", "flight_end"),
        produces=("health", "status_text"),
        backlog=10,
        cpu_budget_percent=10.0,
        memory_limit_mb=500.0,
    ),
    ProcessRow(
        name="guide",
        module="uavrt.drone.processes.guide",
        meaning="flies orders that an operator has confirmed; without it uavrt moves nothing",
        runs=always,
        configured=lambda settings: settings.guidance.enabled,
        consumes=(
            "motion",
            "vehicle",
            "vehicle_fence",
            "neighbour",
            "flight",
            "flight_end",
            "pulse_pose",
            "search_report",
        ),
        produces=(
            "motion_offer",
            "vehicle_request",
            "course",
            "search_note",
            "health",
            "status_text",
        ),
        backlog=500,
        cpu_budget_percent=5.0,
        memory_limit_mb=80.0,
    ),
    ProcessRow(
        name="ros2",
        module="uavrt.drone.processes.ros2_gateway",
        meaning="publishes ROS 2 nodes and topics; accepts commands by ROS 2",
        runs=always,
        configured=lambda settings: settings.ros2.enabled,
        consumes=(
            "pulse",
            "pulse_pose",
            "poses",
            "flight",
            "flight_end",
            "command",
            "command_reply",
            "status_text",
            "system_status",
            "settings",
        ),
        produces=("pulse", "command", "health", "status_text"),
        backlog=500,
        cpu_budget_percent=3.0,
        memory_limit_mb=80.0,
    ),
    ProcessRow(
        name="detector",
        module="uavrt.drone.processes.detector",
        meaning="finds the pulses of several tags",
        runs=while_detecting,
        consumes=(),
        produces=("pulse", "search_report", "health", "status_text"),
        per_worker=True,
        cpu_budget_percent=5.5,
        memory_limit_mb=100.0,
    ),
    ProcessRow(
        name="receiver",
        module="uavrt.drone.processes.receiver",
        meaning="converts radio samples to channels; also records the band",
        runs=while_receiving,
        samples_to="detector",
        consumes=("settings",),
        produces=("beep", "health", "status_text"),
        cpu_budget_percent=4.7,
        memory_limit_mb=150.0,
        # A radio program that ignores SIGTERM is waited for 2 s before it is killed.
        silence_limit_s=5.0,
    ),
)

SUPERVISOR_TOPICS = ("command", "health", "status_text", "records_handled")


def consumers_of(
    topic: str, rows: tuple[ProcessRow, ...] = PROCESSES
) -> tuple[ProcessRow, ...]:
    """Return the rows whose processes receive the records of a topic."""
    return tuple(row for row in rows if topic in row.consumes)
