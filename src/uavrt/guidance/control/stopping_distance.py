"""Stopping distance of a multirotor."""


def stops_within_m(speed_m_s: float) -> float:
    """Distance in which both autopilots stop without turning back [m].

    On both, a target at v²/(2 · 1.5 m/s²) was overshot by 3.3 to 3.7 m if the drone was still
    accelerating: the acceleration changes by 4 to 5 m/s³ at most. The result includes this
    overshoot, and half a second until the command arrives.
    """
    return 1.5 + 1.6 * speed_m_s + speed_m_s**2 / 4.0
