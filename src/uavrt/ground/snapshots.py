"""The ground station's state, ready for JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Protocol

import uavrt
from uavrt.attitude import euler_deg
from uavrt.config.tag_corrections import correction_of, shared_offset_ppm
from uavrt.ground.commanding_page import Commander
from uavrt.ground.fetch.downloads import Downloads
from uavrt.ground.link.actions import action_states
from uavrt.ground.link.flying import Flying
from uavrt.ground.link.my_place import MyPlace
from uavrt.ground.link.session_parts import HeldSession
from uavrt.ground.link.vehicle_identity import VehicleIdentity
from uavrt.ground.store.estimates import Estimates
from uavrt.ground.store.event_log import EventLog
from uavrt.ground.store.tag_table import rows_from_tags, table_version
from uavrt.messages import Beep, Pose
from uavrt.units import NANOSECONDS_PER_SECOND, wrap_degrees_360


class ShownSession(HeldSession, Protocol):
    """What is shown of a session besides; `uavrt.ground.session.GroundSession` has it."""

    identity: VehicleIdentity
    link_error: str | None
    temperature_c: float | None
    heard: dict[int, int]
    commander: Commander
    my_place: MyPlace
    flying: Flying
    downloads: Downloads
    estimates: Estimates
    log: EventLog

    @property
    def skew_ns(self) -> int | None:
        """How far the drone's clock is behind ours; None before it is judged."""

    @property
    def companions(self) -> "Sequence[ShownSession]":
        """Sessions of the other vehicles on the same links."""


def snapshot(session: ShownSession) -> dict[str, Any]:
    """Everything that a page needs besides the flight's pulses."""
    now_ns = session.clock.now_ns()
    link, watch = session.link, session.vehicle
    situation = session.situation()
    pose = watch.pose if watch else None
    return {
        "time_ns": now_ns,
        "version": uavrt.__version__,
        "connection": {
            "address": session.store.settings.address,
            "open": link is not None and link.link is not None,
            "error": session.link_error,
        },
        "drone": {
            "present": situation.drone_present,
            "system_id": session.identity.system_id,
            "unique_number": session.identity.uid,
            "others": sorted(session.identity.others),
            "foreign": situation.foreign,
            "state": session.state.value if session.state else None,
            "cpu_temperature_c": session.temperature_c,
            "directory": session.drone_directory or None,
            "clock_skew_s": None
            if session.skew_ns is None
            else session.skew_ns / NANOSECONDS_PER_SECOND,
        },
        "link": link_state(session, now_ns),
        "vehicle": None if pose is None else pose_record(pose, now_ns),
        "home": None
        if watch is None or watch.home is None
        else {"latitude_deg": watch.home[0], "longitude_deg": watch.home[1]},
        "me": my_place_record(session),
        "armed": watch.armed if watch else None,
        "battery_v": watch.battery_v if watch else None,
        "battery_percent": watch.battery_percent if watch else None,
        "flight": {
            "flight_id": session.flight.flight_id,
            "start_time_ns": session.flight.start_time_ns,
            "ended": session.flight.ended,
            "pulses": session.flight.pulses,
            "fault": session.flight.fault,
        },
        "tags_sent": bool(session.sent_tags) and session.sent_tags == session.store.chosen_tags,
        "detectors": {
            str(tag_id): (now_ns - heard_ns) / NANOSECONDS_PER_SECOND
            for tag_id, heard_ns in session.heard.items()
        },
        "beeps": [beep_record(session, beep) for beep in session.beeps],
        "corrections": [
            {"tag_id": one.tag_id, "text": str(one)} for one in session.store.corrections_listed
        ],
        "common_ppm": shared_offset_ppm(session.beeps),
        "commander": session.commander.present,
        "marks": [asdict(mark) for mark in session.marks],
        "motion": session.flying.record(),
        "fleet": [vehicle_record(one) for one in all_vehicles(session)],
        "busy": None if session.busy is None else asdict(session.busy),
        "actions": action_states(situation),
    }


def beep_record(session: ShownSession, beep: Beep) -> dict[str, Any]:
    """What beeps, in words, and which listed tags it can correct."""
    found = (
        correction_of(tag, beep, 0, session.beeps)
        for tag in session.store.tags
        if tag.tag_id in beep.tag_ids
    )
    corrects = [{"tag_id": one.tag_id, "what": one.what} for one in found if one is not None]
    words = {"meaning": beep.meaning, "odd": beep.odd, "corrects": corrects}
    return asdict(beep) | words


def all_vehicles(session: ShownSession) -> "list[ShownSession]":
    """The sessions of all vehicles, the first first; none where there is but one."""
    if not session.companions:
        return []
    return sorted([session, *session.companions], key=lambda one: one.store.system_id or 0)


def vehicle_record(session: ShownSession) -> dict[str, Any]:
    """One vehicle of several, for the pages of all."""
    now_ns = session.clock.now_ns()
    watch, number = session.vehicle, session.store.system_id
    pose = watch.pose if watch else None
    situation = session.situation()
    return {
        "system_id": session.identity.system_id,
        "name": session.store.settings.vehicle_name,
        "page": "/" if number is None else f"/vehicle/{number}/",
        "present": situation.drone_present,
        "state": session.state.value if session.state else None,
        "pose": None if pose is None else pose_record(pose, now_ns),
        "pulses": session.flight.pulses,
    }


def my_place_record(session: ShownSession) -> dict[str, Any] | None:
    """Where this computer is by its GPS receiver; None where it has none."""
    mine = session.my_place
    if not mine.address:
        return None
    place = mine.place
    return {
        "latitude_deg": None if place is None else place[0],
        "longitude_deg": None if place is None else place[1],
        "age_s": None if place is None else mine.age_s,
        "error": mine.error,
        **mine.counters,
    }


def hello(session: ShownSession) -> dict[str, Any]:
    """The whole present state, for a listener that has just come."""
    return {
        "state": snapshot(session),
        "tags": rows_from_tags(session.store.tags),
        "tags_version": table_version(session.store.tags),
        "settings": asdict(session.store.settings),
        **session.estimates.record(),
        "log": session.log.lines(),
        "download": session.downloads.record(),
    }


def link_state(session: ShownSession, now_ns: int) -> dict[str, Any]:
    """Loss, round trip, radio and counters of the link."""
    link, watch = session.link, session.vehicle
    if link is None or link.link is None or watch is None:
        return {"loss": None, "round_trip_s": None, "radio": None, "counters": {}}
    return {
        "loss": watch.loss.share(now_ns),
        "round_trip_s": watch.round_trip_s,
        "radio": None if watch.radio is None else asdict(watch.radio),
        "counters": {**asdict(link.link.counters), **link.protocol.counters},
    }


def pose_record(pose: Pose, now_ns: int) -> dict[str, Any]:
    """The vehicle's pose as JSON takes it."""
    yaw_deg, pitch_deg, roll_deg = euler_deg(pose.quaternion_wxyz)
    return {
        "time_ns": pose.time_ns,
        "age_s": (now_ns - pose.time_ns) / NANOSECONDS_PER_SECOND,
        "latitude_deg": pose.latitude_deg,
        "longitude_deg": pose.longitude_deg,
        "altitude_amsl_m": pose.altitude_amsl_m,
        "altitude_relative_m": pose.altitude_relative_m,
        "roll_deg": roll_deg,
        "pitch_deg": pitch_deg,
        "heading_deg": wrap_degrees_360(yaw_deg),
    }
