"""Column names of tables in which people note bearings taken by hand.

uavrt's own names are ``tag_id``, ``latitude_deg``, ``longitude_deg``, ``bearing_deg`` (true
north), ``sigma_deg``, ``time_utc`` and ``observer``. Tables of other groups have columns such
as animal, lat, long, azimuth, date and time; case, units and blanks do not matter. A bearing
may be magnetic (``magnetic_azimuth``, or any name with a column ``declination``), and a place
in UTM (``easting``, ``northing`` and ``utm_zone``).
"""

import re
from collections.abc import Iterable

_NAMES = {
    "tag": ("tag_id", "id", "tag", "animal", "animal_id", "name", "individual", "frequency"),
    "latitude": ("latitude", "lat"),
    "longitude": ("longitude", "lon", "long", "lng"),
    "easting": ("easting", "utm_easting", "utm_x", "utm_e", "x"),
    "northing": ("northing", "utm_northing", "utm_y", "utm_n", "y"),
    "zone": ("utm_zone", "zone"),
    "true": ("bearing_deg", "true_bearing", "true_azimuth", "bearing_true", "azimuth_true"),
    "magnetic": (
        *("magnetic_bearing", "magnetic_azimuth", "bearing_magnetic", "azimuth_magnetic"),
        *("bearing_mag", "azimuth_mag", "compass_bearing"),
    ),
    "bearing": ("bearing", "azimuth"),
    "declination": ("declination", "magnetic_declination"),
    "sigma": ("sigma",),
    "time": ("time_utc", "datetime", "date_time", "timestamp"),
    "date": ("date", "date_utc"),
    "clock": ("time",),
    "observer": ("observer", "recorder"),
    "true_latitude": ("true_latitude",),
    "true_longitude": ("true_longitude",),
}
"""Meaning of a column, and its names in order of preference."""
_NEEDED = ("tag", "latitude", "longitude")
_ZONE = re.compile(r"(?:utm\s*)?(\d{1,2})\s*([NS])", re.I)
_UNIT = re.compile(r"\s*[(\[].*[)\]]\s*$")


def noted_columns(heading: Iterable[str]) -> dict[str, int]:
    """Return the places of the columns that a heading names, by meaning: tag, latitude,
    longitude, easting, northing, zone, true, magnetic or bearing, declination, sigma, time,
    date, clock, observer, true_latitude and true_longitude.
    """
    places = {_plain(name): place for place, name in reversed([*enumerate(heading)])}
    found: dict[str, int] = {}
    for meaning, names in _NAMES.items():
        place = next((places[name] for name in names if name in places), None)
        if place is not None:
            found[meaning] = place
    return found


def is_noted(heading: Iterable[str]) -> bool:
    """True if a CSV heading belongs to a table of bearings that were noted by hand; False for
    that of the original system's bearings.csv.
    """
    cells = [*heading]
    known = set(noted_columns(cells))
    noted = bool(known & {"true", "magnetic", "bearing"}) and bool(known & set(_NEEDED))
    return noted and "parent_file" not in cells


def check_noted(columns: Iterable[str]) -> None:
    """Raise `ValueError` if a table of noted bearings lacks a column that is needed."""
    known = set(columns)
    given = known | ({"latitude", "longitude"} if known >= {"easting", "northing"} else set())
    if missing := [name for name in _NEEDED if name not in given]:
        raise ValueError(f"the heading has no column {', '.join(missing)}")
    if not known >= {"latitude", "longitude"} and "zone" not in known:
        raise ValueError("eastings and northings need a column utm_zone, such as 32N or 18S")
    if not known & {"true", "magnetic", "declination"}:
        raise ValueError(
            "the heading does not say from which north bearings count: name the column "
            "bearing_deg (true north) or magnetic_bearing, or add a column declination"
        )


def epsg_of_zone(zone: str) -> int:
    """EPSG number of a UTM zone and hemisphere such as 32N or 18S; raises `ValueError`."""
    found = _ZONE.fullmatch(zone.strip())
    if found is None or not 1 <= int(found[1]) <= 60:
        raise ValueError(f"{zone!r} is not a UTM zone such as 32N (north) or 18S (south)")
    return (32600 if found[2] in "Nn" else 32700) + int(found[1])


def _plain(name: str) -> str:
    """Name in lower case, without its unit: "Bearing (°)" is bearing."""
    plain = re.sub(r"[^a-z0-9]+", "_", _UNIT.sub("", name.lower())).strip("_")
    return plain if plain in ("bearing_deg", "tag_id") else plain.removesuffix("_deg")
