"""The list before a first flight, judged by what one vehicle has reported."""

from uavrt.computer.bench import FlightFacts, first_flight
from uavrt.computer.finding import Finding
from uavrt.config.settings import RecordingSettings
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.store.flights import FlightLibrary
from uavrt.units import NANOSECONDS_PER_SECOND


def usual_noise_db(vehicle: ServedVehicle, library: FlightLibrary) -> float | None:
    """Read how loud the vehicle's receiver was at rest in past flights; takes a while."""
    keeper = vehicle.flight.keeper
    live = None if keeper.ended else keeper.flight_id
    return library.usual_noise_db(vehicle.identity.system_id, but=live)


def first_flight_findings(vehicle: ServedVehicle, noise_db: float | None) -> list[Finding]:
    """Judge whether all is ready for a first flight, with the noise of past ones."""
    now_ns, watch, drone = vehicle.clock.now_ns(), vehicle.connection.watch, vehicle.drone
    pose = watch.pose if watch else None
    facts = FlightFacts(
        tags=vehicle.store.chosen_tags,
        state=drone.state,
        heard=vehicle.connection.present(now_ns),
        clock_off_s=None if drone.skew_ns is None else drone.skew_ns / NANOSECONDS_PER_SECOND,
        pose_age_s=None if pose is None else (now_ns - pose.time_ns) / NANOSECONDS_PER_SECOND,
        disk_free_mb=watch.disk_free_mb if watch else None,
        disk_needed_mb=RecordingSettings().minimum_free_mb,
        battery_percent=watch.battery_percent if watch else None,
        battery_v=watch.battery_v if watch else None,
        usual_noise_db=noise_db,
    )
    return first_flight(facts, drone.bench, now_ns)
