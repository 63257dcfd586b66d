"""Distance that a multirotor needs to stop."""


def stops_within_m(speed_m_s: float) -> float:
    """Return the distance in which a drone stops without turning back [m].

    With PX4 and ArduCopter, a target at v²/(2 · 1.5 m/s²) was overshot by 3.3 to 3.7 m if the
    drone was still accelerating, because the acceleration changes by at most 4 to 5 m/s³. The
    result includes this overshoot, and half a second until the command arrives.
    """
    return 1.5 + 1.6 * speed_m_s + speed_m_s**2 / 4.0
