"""From UTM metres to degrees, WGS84.

Krüger's series in the third flattening to its fourth power (Karney, "Transverse Mercator with
an accuracy of a few nanometers", 2011, eq. 36): far better than a millimetre inside a zone.
"""

import math

_A = 6_378_137.0
_F = 1.0 / 298.257_223_563
_SCALE = 0.9996
_N = _F / (2.0 - _F)
_RADIUS = _A / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64)
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


def geodetic_of_epsg(epsg: int, easting_m: float, northing_m: float) -> tuple[float, float]:
    """Latitude and longitude [deg] of a place in EPSG 32601–32660, 32701–32760 or 4326.

    Raises
    ------
    ValueError
        Another coordinate system, or a place outside it.
    """
    if epsg == 4326:
        lat, lon = northing_m, easting_m
    elif 1 <= epsg - 32600 <= 60 or 1 <= epsg - 32700 <= 60:
        if not (abs(easting_m - 5e5) < 1e6 and abs(northing_m) < 1.1e7):
            raise ValueError(f"{easting_m}, {northing_m} is no place of a UTM zone")
        south = epsg > 32700
        lat, lon = _inverse(easting_m, northing_m - (1e7 if south else 0.0))
        lon += 6.0 * (epsg % 100) - 183.0
    else:
        raise ValueError(f"EPSG {epsg} is neither UTM on WGS84 nor 4326")
    if not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
        raise ValueError(f"{easting_m}, {northing_m} is no place on earth")
    return lat, math.remainder(lon, 360.0)


def _inverse(easting_m: float, northing_m: float) -> tuple[float, float]:
    xi = northing_m / (_SCALE * _RADIUS)
    eta = (easting_m - 5e5) / (_SCALE * _RADIUS)
    xi0 = xi - sum(
        b * math.sin(2 * j * xi) * math.cosh(2 * j * eta) for j, b in enumerate(_BETA, 1)
    )
    eta0 = eta - sum(
        b * math.cos(2 * j * xi) * math.sinh(2 * j * eta) for j, b in enumerate(_BETA, 1)
    )
    chi = math.asin(max(-1.0, min(1.0, math.sin(xi0) / math.cosh(eta0))))
    phi = chi + sum(d * math.sin(2 * j * chi) for j, d in enumerate(_DELTA, 1))
    return math.degrees(phi), math.degrees(math.atan2(math.sinh(eta0), math.cos(xi0)))
