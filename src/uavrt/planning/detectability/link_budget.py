"""Compute the range at which a tag is detected, from transmitted power, path loss, antenna and
noise.

The ratio of a pulse's energy to the noise density is ENR = EIRP + antenna gain - mismatch -
loss + 10 log10(pulse width) - noise density. The loss is that of free space, 20 log10(4 pi d /
wavelength) (ITU-R P.525), or that of the direct ray and the ray reflected by the ground.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.planning.detectability.ground_propagation import GroundReflection
from uavrt.planning.tuning import PLANNING

THERMAL_DBM_HZ = -173.98
"""Noise density of a matched load at 290 K [dBm/Hz]."""

Ground = Literal["two-ray", "free"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkBudget:
    """Link budget of a tag, a drone and the path between them; heights are above the ground.

    `antenna_gain_dbi`: gain in the direction of the tag. `mismatch_db`: loss by polarization,
    cables and an antenna that points elsewhere. `noise_figure_db`: noise of receiver, drone and
    sky relative to thermal noise. `ground`: the model of the path loss, free space or two-ray.
    `drone_noise_db`: noise of the drone, as measured in flight.
    """

    frequency_hz: float
    pulse_width_s: float
    tag_eirp_dbm: float
    drone_height_m: float
    tag_height_m: float = 0.5
    antenna_gain_dbi: float = 4.0
    mismatch_db: float = 3.0
    noise_figure_db: float = 8.0
    ground: Ground = "two-ray"
    drone_noise_db: float = 0.0

    @property
    def enr_at_one_metre_db(self) -> float:
        """ENR if tag and antenna were one metre apart in free space [dB]."""
        return (
            self.tag_eirp_dbm
            + self.antenna_gain_dbi
            - self.mismatch_db
            - self.free_space_db
            + 10.0 * math.log10(self.pulse_width_s)
            - THERMAL_DBM_HZ
            - self.noise_figure_db
            - self.drone_noise_db
        )

    @property
    def free_space_db(self) -> float:
        """Path loss over one metre of free space [dB]."""
        return 20.0 * math.log10(4.0 * math.pi * self.frequency_hz / SPEED_OF_LIGHT_M_S)

    def enr_db(self, ground_m: np.ndarray, *, rise_m: np.ndarray | float = 0.0) -> np.ndarray:
        """ENR at distances over the ground [dB], in an array of the same shape.

        `rise_m` is the height of the ground below the drone above the ground at the tag. The
        reflected ray is computed with the heights above the ground at either end.
        """
        above = self.drone_height_m - self.tag_height_m
        slant = np.maximum(np.hypot(ground_m, above + rise_m), 1.0)
        found = self.enr_at_one_metre_db - 20.0 * np.log10(slant)
        if self.ground == "two-ray":
            reflection = GroundReflection(
                frequency_hz=self.frequency_hz, tag_height_m=self.tag_height_m
            )
            found = found + reflection.gain_db(ground_m, above)
        return np.asarray(found)

    def distance_m(self, needed_db: float) -> float | None:
        """Distance up to which the ENR is at least `needed_db` [m], at most 100 km; None if it
        is too low everywhere.
        """
        places = np.concatenate(
            ([0.0], np.geomspace(1.0, PLANNING.farthest_m, PLANNING.range_places))
        )
        short = np.flatnonzero(self.enr_db(places) < needed_db)
        if not len(short):
            return PLANNING.farthest_m
        return None if short[0] == 0 else float(places[short[0] - 1])

    def lines(self, needed_db: float, distance_m: float) -> list[tuple[str, float, str]]:
        """Return the name, value and unit of each term of the budget, for a table."""
        enr = float(self.enr_db(np.array([distance_m]))[0])
        loss = self.enr_at_one_metre_db + self.free_space_db - enr
        return [
            ("power that the tag radiates", self.tag_eirp_dbm, "dBm"),
            (f"loss over {distance_m:,.0f} m, {self.ground}", -loss, "dB"),
            ("gain of the antenna", self.antenna_gain_dbi, "dBi"),
            ("polarization, pointing, cables", -self.mismatch_db, "dB"),
            (
                "power at the receiver",
                self.tag_eirp_dbm - loss + self.antenna_gain_dbi - self.mismatch_db,
                "dBm",
            ),
            ("thermal noise", THERMAL_DBM_HZ, "dBm/Hz"),
            ("noise of receiver, drone and sky", self.noise_figure_db, "dB"),
            *(
                [("noise of the drone in a past flight", self.drone_noise_db, "dB")]
                if self.drone_noise_db
                else []
            ),
            (
                f"pulse of {self.pulse_width_s * 1e3:g} ms",
                10.0 * math.log10(self.pulse_width_s),
                "dBs",
            ),
            ("energy over noise density, ENR", enr, "dB"),
            ("ENR that the detector needs", needed_db, "dB"),
            ("margin", enr - needed_db, "dB"),
        ]
