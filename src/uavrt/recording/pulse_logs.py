"""The text logs of a flight, kept in step with its database."""

import contextlib
import sqlite3

from uavrt.clock import monotonic_s
from uavrt.messages import PulsePose
from uavrt.recording import schema
from uavrt.recording.layout import FlightLayout
from uavrt.recording.pulse_pose_log import PulsePoseLog, format_line

_RETRY_S = 5.0
"""A log that could not be written is completed from the database, not at every commit."""

SELECT_PULSE_POSES = (
    "SELECT "
    + ", ".join(f"pulses.{column}" for column in schema.PULSE_COLUMNS.split(", "))
    + ", "
    + ", ".join(f"pulse_poses.{column}" for column in schema.POSE_COLUMNS.split(", "))
    + " FROM pulses {join} JOIN pulse_poses USING (pulse_id) ORDER BY pulses.start_time_ns,"
    " pulses.tag_id"
)
PULSE_WIDTH = len(schema.PULSE_COLUMNS.split(", "))


class PulseLogs:
    """``pulse_pose_log.txt`` of the flight and of each tag.

    The database has every line already, so a failure here loses nothing: the logs are
    completed from it as soon as the disk allows.
    """

    def __init__(self, layout: FlightLayout) -> None:
        self._layout = layout
        self._new: list[PulsePose] = []
        self._behind = False
        self._retry_at_s = 0.0

    def take(self, pulse_poses: list[PulsePose]) -> None:
        """Take what was just committed, for the next `write`."""
        self._new.extend(pulse_poses)

    def compare_first(self) -> None:
        """Have the next `write` append only what a log lacks, by tag and time."""
        self._behind = True
        self._retry_at_s = 0.0

    def write(self, database: sqlite3.Connection) -> None:
        """Append what is new; on a failing disk remember that the logs are behind."""
        if not self._new and not self._behind:
            return
        if self._behind:
            self._new.clear()
            if monotonic_s() >= self._retry_at_s:
                with contextlib.suppress(OSError, sqlite3.Error):
                    self.complete_from(database)
            return
        new, self._new = self._new, []
        try:
            self._append(new)
        except OSError:
            self._behind = True
            self._retry_at_s = monotonic_s() + _RETRY_S

    def sync(self) -> None:
        """Bring the flight's log to the disk itself; a tag's own can be made again from it."""
        with contextlib.suppress(OSError):
            PulsePoseLog(self._layout.pulse_pose_log).sync()

    def complete_from(self, database: sqlite3.Connection) -> None:
        """Cut off unfinished lines and append what the database has and a log lacks.

        Raises
        ------
        OSError
            A log cannot be written.
        sqlite3.Error
            The database cannot be read.
        """
        self._retry_at_s = monotonic_s() + _RETRY_S
        rows = database.execute(SELECT_PULSE_POSES.format(join="")).fetchall()
        pulse_poses = [pulse_pose_from_row(row) for row in rows]
        self._complete(PulsePoseLog(self._layout.pulse_pose_log), pulse_poses)
        for tag_id in {pulse_pose.pulse.tag_id for pulse_pose in pulse_poses}:
            own = [one for one in pulse_poses if one.pulse.tag_id == tag_id]
            self._complete(self._tag_log(tag_id), own)
        self._behind = False

    def _append(self, pulse_poses: list[PulsePose]) -> None:
        lines: dict[int, list[str]] = {}
        everything: list[str] = []
        for pulse_pose in pulse_poses:
            line = format_line(pulse_pose)
            everything.append(line)
            lines.setdefault(pulse_pose.pulse.tag_id, []).append(line)
        PulsePoseLog(self._layout.pulse_pose_log).append(everything)
        for tag_id, own in lines.items():
            self._tag_log(tag_id).append(own)

    def _complete(self, log: PulsePoseLog, pulse_poses: list[PulsePose]) -> None:
        present = log.repair()
        missing = [
            format_line(one)
            for one in pulse_poses
            if (one.pulse.tag_id, one.pulse.start_time_ns) not in present
        ]
        if missing:
            log.append(missing)

    def _tag_log(self, tag_id: int) -> PulsePoseLog:
        path = self._layout.tag_pulse_pose_log(tag_id)
        path.parent.mkdir(parents=True, exist_ok=True)
        return PulsePoseLog(path)


def pulse_pose_from_row(row: schema.Row) -> PulsePose:
    """Pulse with pose of a row of `SELECT_PULSE_POSES`."""
    return PulsePose(
        pulse=schema.pulse_from_row(row[:PULSE_WIDTH]),
        pose=schema.pose_from_row(row[PULSE_WIDTH:]),
    )
