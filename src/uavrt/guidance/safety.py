"""Safety limits of guidance: when an order ends, and when a command may be sent.

The use of each limit, and the measurements behind it, are in docs/explanation/takeover.md.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyLimits:
    """Safety limits that no setting can change. A comment applies to the fields below it."""

    # An order: longest times from its offer to its confirmation, and to its first command [s].
    offer_holds_s: float = 10.0
    begins_within_s: float = 10.0
    refusals: int = 50
    """Number of refused requests in a row above which the order ends."""
    planner_lost_s: float = 2.0
    """Silence of the guide process after which the order ends [s]."""
    stall_s: float = 1.0
    """Longest pause of the connection process that ends no order [s]; reports wait
    meanwhile."""
    battery_s: float = 1.0
    """Time between two checks that the battery suffices for the return [s]."""

    # Age of a report above which no command is sent [s].
    mode_age_s: float = 1.0
    mode_change_age_s: float = 0.2
    """Largest age of the mode report when a command changes the mode [s]."""
    position_age_s: float = 0.5
    target_age_s: float = 0.3
    """Largest age of the target report for commands after an order's first [s]."""
    sticks_age_s: float = 0.3
    """Largest age of the RC report when a command is sent [s]; autopilots send it at 5 Hz or
    more."""
    # Age of a report above which the order ends, or the report is ignored [s].
    mode_lost_s: float = 3.0
    position_lost_s: float = 2.0
    sticks_lost_s: float = 1.5
    landed_age_s: float = 3.0
    heartbeat_lost_s: float = 5.0
    """Time without the autopilot's heartbeat after which an order ends [s]; only it reports
    disarming."""
    latest_telemetry_s: float = 0.2
    """Largest delay of the autopilot's messages with which commands are sent [s]."""
    clock_drift: float = 2e-4
    """Largest relative difference in speed of the autopilot's and the computer's clock: 100 ppm
    each."""

    # Movement of a stick or a switch that is the pilot's [µs]; three-way switches move by 500.
    stick_us: int = 60
    switch_us: int = 250
    switch_moved_s: float = 0.1
    """Time after which one RC message with a moved switch counts [s]; a second such message
    counts at once."""
    first_switch: int = 5
    """Number of the first RC channel checked as a switch; 1 to 4 are the sticks."""

    # Jumps of home since the confirmation, of altitude and of position that end the order [m].
    home_moved_m: float = 2.0
    height_jump_m: float = 5.0
    place_jump_m: float = 30.0
    home_height_error_m: float = 15.0
    """Largest difference between home's altitudes by map and autopilot [m]; above it, no order
    is planned."""
    flying_height_m: float = 2.0
    """Height above home from which a drone counts as flying if it reports no landed state
    [m]."""
    lowest_height_m: float = 20.0
    """Lowest height of a commanded target above ground [m]; the settings may change it."""
    gust_below_m: float = 1.0
    """Amount by which a height may be below a limit [m]; gusts lower a hovering drone."""
    margin_m: float = 5.0
    """Distance that paths keep from the outlines of people and buildings [m], for gusts and
    bends."""
    calm_share: float = 0.9
    """Strongest wind in which orders are flown, as a fraction of the drone's airspeed."""

    # Longest times from a command, and from one to take off, until the drone must react [s].
    obeyed_within_s: float = 3.0
    takeoff_begins_within_s: float = 10.0
    in_air_unsure_s: float = 2.0
    """Longest time for which a vehicle on the ground may be reported as flying [s]; PX4 1.17
    (SIH) did so for 1.0 s after arming."""
    # Times after a command in which reports may predate it [s]. Targets change in 0.05 to
    # 0.09 s; PX4 reports the mode at 2 Hz.
    target_changes_s: float = 0.5
    mode_changes_s: float = 1.5
    # Rise at which a take-off is obeyed, and distance below the top at which it is done [m].
    takeoff_rise_m: float = 1.0
    takeoff_done_m: float = 3.0

    # Errors that end the order: farther from the target than before [m] beyond what braking
    # takes, height [m], the drone's own heading, and the one that it reports as its target [°].
    astray_m: float = 6.0
    height_error_m: float = 5.0
    yaw_deg: float = 25.0
    target_yaw_deg: float = 2.0
    gust_heading_deg: float = 15.0
    """Largest deviation of the heading from the target's bearing that gusts may cause [°]."""
    # Weakest braking of a flight [m/s²] and of a turn [°/s²].
    braking_m_s2: float = 1.5
    turn_braking_deg_s2: float = 25.0
    setpoint_braking_deg_s2: float = 20.0
    """Deceleration with which the autopilot's heading setpoint stops a turn [°/s²]; PX4 1.17,
    MPC_YAWRAUTO_ACC."""
    setpoint_rests_deg_s: float = 1.5
    """Largest turn rate at which the autopilot's heading setpoint counts as at rest [°/s]."""
    leg_speed_m_s: float = 1.5
    """Speed below which a drone has no reason to brake, even near its target [m/s]. If it still
    brakes, no further command is sent."""

    # Remaining distance [m], height difference [m] and angle [°] at which a step is done.
    arrived_m: float = 3.0
    at_height_m: float = 2.0
    at_yaw_deg: float = 8.0
    no_progress_s: float = 3.0
    """Time without progress towards the target after which an order ends [s]. It is longer than
    the reaction to a command: PX4 1.17 (SIH) made progress 0.7 to 1.3 s after a command from
    rest, and up to 2.495 s after one that replaced a target (104 commands)."""
    slow_progress_s: float = 1.0
    """Time without progress towards the target after which no further command is sent [s]."""
    # Least change in `no_progress_s` that is progress; wind may slow a drone to that.
    nearer_m: float = 0.5
    higher_m: float = 0.3
    turned_deg: float = 3.0
    # A drone brakes if its stopping point moves less than this in this time [s, m].
    braking_s: float = 0.5
    braking_m: float = 0.1
    sample_s: float = 0.1
    """Time between two position reports [s], added to the time of a progress check."""

    # Remaining angle at which a turn is done, and turned angle that shows its beginning [°].
    turn_done_deg: float = 6.0
    turn_begun_deg: float = 5.0
    heading_stays_m: float = 0.7
    """Distance from the target below which the heading must not change [m]; PX4 stops turning
    at 1 to 2 m."""
    bearing_place_error_m: float = 0.1
    """Position error that is allowed for when the heading is compared with the target's bearing
    [m]. On 1757 legs of PX4 1.17 and ArduCopter 4.7, 0.02 m would have sufficed."""
    # Tolerance of a measured heading that was on the bearing for some time [°, s]. On 68 legs
    # of PX4 1.17 and ArduCopter 4.7 it then stayed within 4.2° of the bearing farther than 3 m
    # from the target, and within 2.2° of itself nearer than `heading_stays_m`.
    aligned_deg: float = 12.0
    aligned_s: float = 1.0
    settled_deg: float = 0.3
    """Largest change between two reports at which a heading counts as at rest [°]."""
    # A setpoint may stop on its way to the bearing: nearer than this [m], or for this time [s].
    frozen_m: float = 2.5
    stopped_s: float = 1.0
    turn_made_up_s: float = 6.0
    """Time after a command in which a turn in progress may be stopped and reversed [s]."""
    report_delay_s: float = 0.3
    """Time after a command in which a reported heading setpoint may be from before it [s]."""
    # A heading that follows the course turns by this angle in this time [s, °]. After a new
    # target near the old one ArduCopter 4.7 swung by 38° beyond the bearing, 0.4 s behind it.
    course_follow_s: float = 1.0
    course_follow_deg: float = 3.0
    either_way_deg: float = 150.0
    """Angle between heading and course from which the heading may turn in either direction
    [°]."""
    # Least speeds at which ArduCopter's heading follows the course [m/s]: 5 % of its speed,
    # and nearer than `frozen_m`, where it returns from its overshoot.
    course_m_s: float = 0.5
    near_course_m_s: float = 1.0
    # A heading that changes more slowly than this, for this time, is at rest [°/s, s].
    turning_deg_s: float = 4.0
    turned_s: float = 0.5
    # A turn in place begins once the heading has stayed within this angle for this time, and
    # the drone is slower than `course_m_s` [°, s]. ArduCopter 4.7 (SITL) turned on by 70° from
    # 160 °/s, and ended a turn of 360° 13° short that began at the peak of an overshoot.
    rest_deg: float = 5.0
    rest_s: float = 1.0

    # Speeds below which the drone stands, and a leg may begin in any direction [m/s].
    standing_speed_m_s: float = 1.0
    free_speed_m_s: float = 2.0
    # Greatest bend between two legs flown without a stand [°], and least distance of both
    # places for that [m]: nearer, a small bend is a large one.
    bend_deg: float = 30.0
    bend_from_m: float = 25.0

    # Other drones: greatest age of a report, longest wait for a requested path, and
    # silence after which a drone's tags go back to the others, but not its paths [s].
    report_age_s: float = 10.0
    answer_s: float = 3.0
    missing_s: float = 10.0


SAFETY = SafetyLimits()


def stops_within_m(speed_m_s: float) -> float:
    """Return the distance in which a drone stops without turning back [m].

    With PX4 and ArduCopter, a target at v²/(2 · 1.5 m/s²) was overshot by 3.3 to 3.7 m if the
    drone was still accelerating, because the acceleration changes by at most 4 to 5 m/s³. The
    result includes this overshoot, and half a second until the command arrives.
    """
    return 1.5 + 1.6 * speed_m_s + speed_m_s**2 / 4.0
