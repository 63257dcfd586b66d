"""Format a position as decimal degrees, DMS, UTM and MGRS.

MGRS letters follow NGA.SIG.0012, WGS 84 scheme "AA".
"""

from dataclasses import dataclass

from uavrt.core.earth.geodesy import Utm, utm

_COLUMNS = ("ABCDEFGH", "JKLMNPQR", "STUVWXYZ")
_ROWS = "ABCDEFGHJKLMNPQRSTUV"


@dataclass(frozen=True, slots=True, kw_only=True)
class Readout:
    """One position as text in every notation."""

    decimal: str
    dms: str
    utm: str | None
    """UTM notation; None beyond 84° north and 80° south, where UTM ends."""
    mgrs: str | None


def readout(latitude_deg: float, longitude_deg: float) -> Readout:
    """Format a position in every notation, rounded to about a metre."""
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
    """Format degrees, minutes and seconds to a tenth, with the letter of the hemisphere.

    >>> dms(-41.5, "NS")
    '41°30′00.0″S'
    """
    tenths = round(abs(angle_deg) * 36_000)
    degrees, rest = divmod(tenths, 36_000)
    minutes, rest = divmod(rest, 600)
    letter = letters[1] if angle_deg < 0 else letters[0]
    return f"{degrees}°{minutes:02d}′{rest / 10:04.1f}″{letter}"


def mgrs(place: Utm) -> str:
    """Format a UTM position as MGRS, to the metre (truncated)."""
    easting, northing = int(place.easting_m), int(place.northing_m)
    column = _COLUMNS[(place.zone - 1) % 3][easting // 100_000 - 1]
    shift = 0 if place.zone % 2 else 5
    row = _ROWS[(northing // 100_000 + shift) % 20]
    square = f"{place.zone}{place.band} {column}{row}"
    return f"{square} {easting % 100_000:05d} {northing % 100_000:05d}"
