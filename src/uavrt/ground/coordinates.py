"""A place as people read it out: decimal degrees, DMS, UTM, MGRS.

UTM by Krüger's series in the third flattening to the sixth order (C. F. F. Karney, "Transverse
Mercator with an accuracy of a few nanometers", J. Geodesy 85, 2011, equations 11 and 35), good
to well under a millimetre inside a zone. MGRS lettering: NGA.SIG.0012, WGS 84 scheme "AA".
"""

import math
from dataclasses import asdict, dataclass

_A = 6_378_137.0
_F = 1.0 / 298.257_223_563
_N = _F / (2.0 - _F)
_E = math.sqrt(_F * (2.0 - _F))
_SCALE = 0.9996
_FALSE_EASTING, _FALSE_NORTHING = 500_000.0, 10_000_000.0
_RADIUS = _A / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64 + _N**6 / 256)
_ALPHA = (
    _N / 2 - 2 / 3 * _N**2 + 5 / 16 * _N**3 + 41 / 180 * _N**4 - 127 / 288 * _N**5,
    13 / 48 * _N**2 - 3 / 5 * _N**3 + 557 / 1440 * _N**4 + 281 / 630 * _N**5,
    61 / 240 * _N**3 - 103 / 140 * _N**4 + 15061 / 26880 * _N**5,
    49561 / 161280 * _N**4 - 179 / 168 * _N**5,
    34729 / 80640 * _N**5,
)
_BANDS = "CDEFGHJKLMNPQRSTUVWX"
_COLUMNS = ("ABCDEFGH", "JKLMNPQR", "STUVWXYZ")
_ROWS = "ABCDEFGHJKLMNPQRSTUV"


@dataclass(frozen=True, slots=True, kw_only=True)
class Utm:
    """A place in the Universal Transverse Mercator grid."""

    zone: int
    band: str
    easting_m: float
    northing_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Readout:
    """One place, written in every way."""

    decimal: str
    dms: str
    utm: str | None
    """None beyond 84° north and 80° south, where UTM ends."""
    mgrs: str | None

    def as_dict(self) -> dict[str, str | None]:
        """As JSON takes it."""
        return asdict(self)


def readout(latitude_deg: float, longitude_deg: float) -> Readout:
    """Write a place in every way, to about a metre."""
    grid = utm(latitude_deg, longitude_deg)
    return Readout(
        decimal=f"{latitude_deg:.5f}, {longitude_deg:.5f}",
        dms=f"{dms(latitude_deg, 'NS')} {dms(longitude_deg, 'EW')}",
        utm=None
        if grid is None
        else f"{grid.zone}{grid.band} {grid.easting_m:.0f} {grid.northing_m:.0f}",
        mgrs=None if grid is None else mgrs(grid),
    )


def dms(angle_deg: float, letters: str) -> str:
    """Write degrees, minutes and seconds to a tenth, with the letter of the hemisphere.

    >>> dms(-41.5, "NS")
    '41°30′00.0″S'
    """
    tenths = round(abs(angle_deg) * 36_000)
    degrees, rest = divmod(tenths, 36_000)
    minutes, rest = divmod(rest, 600)
    letter = letters[1] if angle_deg < 0 else letters[0]
    return f"{degrees}°{minutes:02d}′{rest / 10:04.1f}″{letter}"


def utm(latitude_deg: float, longitude_deg: float) -> Utm | None:
    """Project a place; None where UTM does not reach."""
    if not -80.0 <= latitude_deg <= 84.0:
        return None
    longitude_deg = (longitude_deg + 180.0) % 360.0 - 180.0
    zone = _zone(latitude_deg, longitude_deg)
    phi = math.radians(latitude_deg)
    lam = math.radians(longitude_deg - (zone * 6 - 183))
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


def mgrs(place: Utm) -> str:
    """Write a UTM place in the Military Grid Reference System, to the metre (truncated)."""
    easting, northing = int(place.easting_m), int(place.northing_m)
    column = _COLUMNS[(place.zone - 1) % 3][easting // 100_000 - 1]
    shift = 0 if place.zone % 2 else 5
    row = _ROWS[(northing // 100_000 + shift) % 20]
    square = f"{place.zone}{place.band} {column}{row}"
    return f"{square} {easting % 100_000:05d} {northing % 100_000:05d}"


def _zone(latitude_deg: float, longitude_deg: float) -> int:
    """Zone of a place, with the exceptions of Norway and Svalbard."""
    if 56.0 <= latitude_deg < 64.0 and 3.0 <= longitude_deg < 12.0:
        return 32
    if latitude_deg >= 72.0 and 0.0 <= longitude_deg < 42.0:
        return 31 + 2 * int((longitude_deg + 3.0) // 12.0)
    return int((longitude_deg + 180.0) // 6.0) + 1
