"""The ground station's state as JSON values."""

from dataclasses import asdict
from typing import Any

import uavrt
from uavrt.config.tags.tag_corrections import correction_of, shared_offset_ppm
from uavrt.core.earth.attitude import euler_deg
from uavrt.core.messages import Beep, Pose
from uavrt.core.units import NANOSECONDS_PER_SECOND, wrap_degrees_360
from uavrt.ground.link.button_states import action_states
from uavrt.ground.link.my_place import MyPlace
from uavrt.ground.link.served_vehicle import ServedVehicle


def snapshot(vehicle: ServedVehicle) -> dict[str, Any]:
    """State of a vehicle for its page, without the flight's pulses."""
    now_ns = vehicle.clock.now_ns()
    watch = vehicle.connection.watch
    drone, keeper = vehicle.drone, vehicle.flight.keeper
    situation = vehicle.situation()
    pose = watch.pose if watch else None
    return {
        "time_ns": now_ns,
        "version": uavrt.__version__,
        "connection": {
            "address": vehicle.store.settings.address,
            "open": situation.link_open,
            "error": vehicle.connection.error,
        },
        "drone": {
            "present": situation.drone_present,
            "system_id": vehicle.identity.system_id,
            "unique_number": vehicle.identity.uid,
            "others": sorted(vehicle.identity.others),
            "foreign": situation.foreign,
            "state": drone.state.value if drone.state else None,
            "cpu_temperature_c": drone.temperature_c,
            "directory": drone.directory or None,
            "clock_skew_s": None
            if drone.skew_ns is None
            else drone.skew_ns / NANOSECONDS_PER_SECOND,
        },
        "link": link_state(vehicle, now_ns),
        "vehicle": None if pose is None else pose_record(pose, now_ns),
        "home": None
        if watch is None or watch.home is None
        else {"latitude_deg": watch.home[0], "longitude_deg": watch.home[1]},
        "armed": watch.armed if watch else None,
        "battery_v": watch.battery_v if watch else None,
        "battery_percent": watch.battery_percent if watch else None,
        "flight": {
            "flight_id": keeper.flight_id,
            "start_time_ns": keeper.start_time_ns,
            "ended": keeper.ended,
            "pulses": keeper.pulses,
            "fault": keeper.queue.fault,
        },
        "tags_sent": bool(drone.sent_tags) and drone.sent_tags == vehicle.store.chosen_tags,
        "detectors": {
            str(tag_id): (now_ns - heard_ns) / NANOSECONDS_PER_SECOND
            for tag_id, heard_ns in drone.heard.items()
        },
        "beeps": [beep_record(vehicle, beep) for beep in drone.beeps],
        "corrections": [
            {"tag_id": one.tag_id, "text": str(one)} for one in vehicle.store.corrections_listed
        ],
        "common_ppm": shared_offset_ppm(drone.beeps),
        "marks": [asdict(mark) for mark in vehicle.flight.marks],
        "fleet": [vehicle_record(one) for one in all_vehicles(vehicle)],
        "busy": None if vehicle.busy is None else asdict(vehicle.busy),
        "actions": action_states(situation),
    }


def beep_record(vehicle: ServedVehicle, beep: Beep) -> dict[str, Any]:
    """Describe a measured pulse train for the page, with the tags that it may correct."""
    found = (
        correction_of(tag, beep, 0, vehicle.drone.beeps)
        for tag in vehicle.store.tags
        if tag.tag_id in beep.tag_ids
    )
    corrects = [{"tag_id": one.tag_id, "what": one.what} for one in found if one is not None]
    words = {"meaning": beep.meaning, "odd": beep.odd, "corrects": corrects}
    return asdict(beep) | words


def all_vehicles(vehicle: ServedVehicle) -> list[ServedVehicle]:
    """State of each served vehicle, main vehicle first; empty if there is only one."""
    if not vehicle.companions:
        return []
    return sorted([vehicle, *vehicle.companions], key=lambda one: one.store.system_id or 0)


def vehicle_record(vehicle: ServedVehicle) -> dict[str, Any]:
    """Number, name, contact, state and pose of a vehicle, for the pages of all vehicles."""
    now_ns = vehicle.clock.now_ns()
    watch, number = vehicle.connection.watch, vehicle.store.system_id
    pose = watch.pose if watch else None
    situation = vehicle.situation()
    return {
        "system_id": vehicle.identity.system_id,
        "name": vehicle.store.settings.vehicle_name,
        "page": "/" if number is None else f"/vehicle/{number}/",
        "present": situation.drone_present,
        "state": situation.state.value if situation.state else None,
        "pose": None if pose is None else pose_record(pose, now_ns),
        "pulses": vehicle.flight.keeper.pulses,
    }


def my_place_record(mine: MyPlace) -> dict[str, Any] | None:
    """GPS position of this computer for the page; None without a receiver."""
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


def link_state(vehicle: ServedVehicle, now_ns: int) -> dict[str, Any]:
    """Frame loss, round trip, radio and counters of the link, as JSON values."""
    link, watch = vehicle.connection.link, vehicle.connection.watch
    if link is None or link.link is None or watch is None:
        return {"loss": None, "round_trip_s": None, "radio": None, "counters": {}}
    return {
        "loss": watch.loss.share(now_ns),
        "round_trip_s": watch.round_trip_s,
        "radio": None if watch.radio is None else asdict(watch.radio),
        "counters": {**asdict(link.link.counters), **link.protocol.counters},
    }


def pose_record(pose: Pose, now_ns: int) -> dict[str, Any]:
    """The vehicle's pose as JSON values."""
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
