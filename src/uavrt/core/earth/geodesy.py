"""Distances on the ellipsoid (WGS 84), and conversion to and from UTM.

UTM by Krüger's series in the third flattening (C. F. F. Karney, "Transverse Mercator with an
accuracy of a few nanometers", J. Geodesy 85, 2011, equations 11, 35 and 36), exact to well
below a millimetre inside a zone. Metres around a point: `uavrt.core.earth.tangent_plane`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from uavrt.core.units import wrap_degrees_180

SEMI_MAJOR_M = 6_378_137.0
"""Semi-major axis of WGS 84 [m] (NIMA TR8350.2)."""
FLATTENING = 1.0 / 298.257_223_563
SEMI_MINOR_M = SEMI_MAJOR_M * (1.0 - FLATTENING)
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)
SECOND_ECCENTRICITY2 = ECCENTRICITY2 / (1.0 - ECCENTRICITY2)

_N = FLATTENING / (2.0 - FLATTENING)
_E = math.sqrt(ECCENTRICITY2)
_STANDING_M = 50.0
_SCALE = 0.9996
_FALSE_EASTING, _FALSE_NORTHING = 500_000.0, 10_000_000.0
_RADIUS = SEMI_MAJOR_M / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64 + _N**6 / 256)
_ALPHA = (
    _N / 2 - 2 / 3 * _N**2 + 5 / 16 * _N**3 + 41 / 180 * _N**4 - 127 / 288 * _N**5,
    13 / 48 * _N**2 - 3 / 5 * _N**3 + 557 / 1440 * _N**4 + 281 / 630 * _N**5,
    61 / 240 * _N**3 - 103 / 140 * _N**4 + 15061 / 26880 * _N**5,
    49561 / 161280 * _N**4 - 179 / 168 * _N**5,
    34729 / 80640 * _N**5,
)
_BETA = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440,
    17 * _N**3 / 480 - 37 * _N**4 / 840,
    4397 * _N**4 / 161280,
)
_DELTA = (
    2 * _N - 2 * _N**2 / 3 - 2 * _N**3 + 116 * _N**4 / 45,
    7 * _N**2 / 3 - 8 * _N**3 / 5 - 227 * _N**4 / 45,
    56 * _N**3 / 15 - 136 * _N**4 / 35,
    4279 * _N**4 / 630,
)
_BANDS = "CDEFGHJKLMNPQRSTUVWX"


@dataclass(frozen=True, slots=True, kw_only=True)
class Utm:
    """A position in the Universal Transverse Mercator grid."""

    zone: int
    band: str
    easting_m: float
    northing_m: float


def utm(latitude_deg: float, longitude_deg: float, *, zone: int | None = None) -> Utm | None:
    """Project a position to UTM, in its own zone or in `zone`; None near the poles."""
    if not -80.0 <= latitude_deg <= 84.0:
        return None
    longitude_deg = wrap_degrees_180(longitude_deg)
    zone = _zone(latitude_deg, longitude_deg) if zone is None else zone
    phi = math.radians(latitude_deg)
    lam = math.radians(wrap_degrees_180(longitude_deg - (zone * 6 - 183)))
    tau = math.tan(phi)
    sigma = math.sinh(_E * math.atanh(_E * tau / math.hypot(1.0, tau)))
    tau1 = tau * math.hypot(1.0, sigma) - sigma * math.hypot(1.0, tau)
    xi1 = math.atan2(tau1, math.cos(lam))
    eta1 = math.asinh(math.sin(lam) / math.hypot(tau1, math.cos(lam)))
    xi, eta = xi1, eta1
    for order, alpha in enumerate(_ALPHA, start=1):
        xi += alpha * math.sin(2 * order * xi1) * math.cosh(2 * order * eta1)
        eta += alpha * math.cos(2 * order * xi1) * math.sinh(2 * order * eta1)
    northing = _SCALE * _RADIUS * xi
    return Utm(
        zone=zone,
        band=_BANDS[min(int((latitude_deg + 80.0) // 8.0), 19)],
        easting_m=_FALSE_EASTING + _SCALE * _RADIUS * eta,
        northing_m=northing + (_FALSE_NORTHING if latitude_deg < 0.0 else 0.0),
    )


def moved(
    latitude_deg: float, longitude_deg: float, height_m: float, north_m: float, east_m: float
) -> tuple[float, float]:
    """Latitude and longitude [°] of a point that is some metres north and east of another."""
    latitude_rad = math.radians(latitude_deg)
    flattening = 1.0 - ECCENTRICITY2 * math.sin(latitude_rad) ** 2
    prime_vertical_m = SEMI_MAJOR_M / math.sqrt(flattening) + height_m
    meridian_m = SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / flattening**1.5 + height_m
    # At a pole a longitude means nothing; 1 m of its circle keeps the division finite.
    circle_m = max(prime_vertical_m * math.cos(latitude_rad), 1.0)
    north_deg = latitude_deg + math.degrees(north_m / meridian_m)
    east_deg = longitude_deg + math.degrees(east_m / circle_m)
    return max(-90.0, min(90.0, north_deg)), wrap_degrees_180(east_deg)


def distance_m(
    latitude_deg: float,
    longitude_deg: float,
    other_latitude_deg: float,
    other_longitude_deg: float,
) -> float:
    """Distance between two nearby positions [m], by the ellipsoid's radii of curvature."""
    middle_rad = math.radians(0.5 * (latitude_deg + other_latitude_deg))
    flattening = 1.0 - ECCENTRICITY2 * math.sin(middle_rad) ** 2
    prime_vertical_m = SEMI_MAJOR_M / math.sqrt(flattening)
    meridian_m = SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / flattening**1.5
    north = math.radians(other_latitude_deg - latitude_deg)
    east = math.radians(wrap_degrees_180(other_longitude_deg - longitude_deg))
    return math.hypot(north * meridian_m, east * prime_vertical_m * math.cos(middle_rad))


def geodetic_of_epsg(epsg: int, easting_m: float, northing_m: float) -> tuple[float, float]:
    """Latitude and longitude [°] of coordinates in EPSG 32601–32660, 32701–32760 or 4326."""
    if epsg == 4326:
        lat, lon = northing_m, easting_m
    elif 1 <= epsg - 32600 <= 60 or 1 <= epsg - 32700 <= 60:
        if not (abs(easting_m - _FALSE_EASTING) < 1e6 and abs(northing_m) < 1.1e7):
            raise ValueError(
                f"easting {easting_m}, northing {northing_m} are not in a UTM zone"
            )
        south = epsg > 32700
        lat, lon = _inverse_utm(easting_m, northing_m - (_FALSE_NORTHING if south else 0.0))
        lon += 6.0 * (epsg % 100) - 183.0
    else:
        raise ValueError(f"EPSG:{epsg} is not supported: use UTM on WGS84 or EPSG:4326")
    if not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
        raise ValueError(
            f"easting {easting_m}, northing {northing_m} is not a position on earth"
        )
    return lat, math.remainder(lon, 360.0)


def _inverse_utm(easting_m: float, northing_m: float) -> tuple[float, float]:
    xi = northing_m / (_SCALE * _RADIUS)
    eta = (easting_m - _FALSE_EASTING) / (_SCALE * _RADIUS)
    xi0 = xi - sum(
        b * math.sin(2 * j * xi) * math.cosh(2 * j * eta) for j, b in enumerate(_BETA, 1)
    )
    eta0 = eta - sum(
        b * math.cos(2 * j * xi) * math.sinh(2 * j * eta) for j, b in enumerate(_BETA, 1)
    )
    chi = math.asin(max(-1.0, min(1.0, math.sin(xi0) / math.cosh(eta0))))
    phi = chi + sum(d * math.sin(2 * j * chi) for j, d in enumerate(_DELTA, 1))
    return math.degrees(phi), math.degrees(math.atan2(math.sinh(eta0), math.cos(xi0)))


def _zone(latitude_deg: float, longitude_deg: float) -> int:
    if 56.0 <= latitude_deg < 64.0 and 3.0 <= longitude_deg < 12.0:
        return 32
    if latitude_deg >= 72.0 and 0.0 <= longitude_deg < 42.0:
        return 31 + 2 * int((longitude_deg + 3.0) // 12.0)
    return int((longitude_deg + 180.0) // 6.0) + 1


def are_one_place(places: Sequence[tuple[float, float]]) -> bool:
    """True if two or more positions (latitude, longitude [deg]) are those of a standing
    receiver: all within 50 m of their median. GPS without correction scatters by 5 to 10 m.
    """
    if len(places) < 2:
        return False
    middle = median(place[0] for place in places), median(place[1] for place in places)
    return all(distance_m(*place, *middle) <= _STANDING_M for place in places)
