"""A flight as the ground station records it: a turn at each of two places, past a tag."""

import math
import shutil
from pathlib import Path

import made
import numpy as np
from sql import sql

from uavrt.core.clock import Clock
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pulse, PulsePose, Tag
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.localization.antenna import PATTERNS

TAG = made.tag(2, 148_712_000.0, 1.2, name="lynx")
GAIN_DB = PATTERNS["RA-23K"].e_plane_db
"""The antenna that the page takes unless told otherwise."""
PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
STATIONS = ((0.0, 0.0), (250.0, 0.0))
"""East and north of the origin [m]: a turn on the spot at each."""
NOON_NS, DAY_NS = 1_777_636_800 * 10**9, 86_400 * 10**9
"""Of 1 May 2026."""


def write_flight(
    directory: Path, east_m: float, north_m: float, silent: tuple[Tag, ...] = ()
) -> str:
    """Record a flight that turned at two places and heard a tag at (east, north).

    Others were listed, and nothing of them was heard.
    """
    keeper = FlightKeeper(directory, Clock.start())
    flight_id = keeper.begin([TAG, *silent])
    for number in range(72):
        station = STATIONS[number // 36]
        heading = math.radians(10.0 * (number % 36))
        bearing = math.atan2(east_m - station[0], north_m - station[1])
        off_deg = abs((math.degrees(heading - bearing) + 180.0) % 360.0 - 180.0)
        snr_db = 24.0 + float(
            np.interp(off_deg, np.linspace(0.0, 180.0, len(GAIN_DB)), GAIN_DB)
        )
        # Half a minute from one place to the other.
        time_ns = keeper.start_time_ns + round(1.2e9 * number) + round(30e9) * (number // 36)
        latitude, longitude = PLANE.to_geodetic(*station)
        pose = made.pose(
            time_ns,
            latitude,
            longitude,
            quaternion_wxyz=(math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)),
        )
        keeper.add_pose(pose)
        keeper.add_pulse(PulsePose(pulse=pulse_at(time_ns, number, snr_db), pose=pose))
    keeper.close()
    return flight_id


def write_days(directory: Path, days: int) -> list[str]:
    """Write flights at noon of days in May 2026, of tag 2 on odd and tag 4 on even days."""
    directory.mkdir(exist_ok=True)
    first = write_flight(directory, 120.0, 300.0)
    names = []
    for number in range(days):
        name = f"flight_log_2026-05-{number + 1:02d}_12-00-00"
        shutil.copytree(directory / first, directory / name)
        ((start_ns,),) = sql(directory / name, "SELECT start_time_ns FROM flight")
        later_ns = NOON_NS + number * DAY_NS - start_ns
        start = f"start_time_ns = start_time_ns + {later_ns}"
        sql(
            directory / name,
            f"UPDATE flight SET {start}",
            f"UPDATE pulses SET {start}, end_time_ns = end_time_ns + {later_ns}",
            f"UPDATE poses SET time_ns = time_ns + {later_ns}",
            f"UPDATE tags SET tag_id = {2 + 2 * (number % 2)}",
        )
        names.append(name)
    shutil.rmtree(directory / first)
    return names


def pulse_at(time_ns: int, number: int, snr_db: float) -> Pulse:
    return made.pulse(
        time_ns,
        frequency_hz=148_712_000.0,
        snr_db=snr_db,
        group_index=1 + number % 3,
        group_sequence=number // 3,
        noise_psd=1e-9,
    )
