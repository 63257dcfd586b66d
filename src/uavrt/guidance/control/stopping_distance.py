"""Stopping distance of a multirotor. Pure."""


def stops_within_m(speed_m_s: float) -> float:
    """Distance in which both autopilots stop without turning back [m].

    The acceleration changes by 4 to 5 m/s³ at most, which adds an overshoot of 3.3 to 3.7 m to
    v²/(2 · 1.5 m/s²). Half a second until the command arrives is included.
    """
    return 1.5 + 1.6 * speed_m_s + speed_m_s**2 / 4.0
