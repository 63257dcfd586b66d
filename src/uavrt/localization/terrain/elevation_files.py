"""Open elevation files, given as one file or as a folder of tiles."""

from collections.abc import Iterator
from pathlib import Path

from uavrt.core.errors import FormatError
from uavrt.localization.terrain import geotiff_elevation as geotiff
from uavrt.localization.terrain import srtm
from uavrt.localization.terrain.elevation import ELLIPSOID, Elevation, Raster

_REMEDY = "Name a tile (N47E008.hgt), a GeoTIFF of heights (.tif), or a folder of these"


def open_elevation(path: Path, *, sea: bool = False) -> Elevation:
    """Open an elevation file, or all elevation files of a folder. Raises `FormatError`.

    With `sea`, positions outside all files count as water at height 0, because there are no
    tiles for the open sea.
    """
    if not path.exists():
        raise FormatError(f"there is no {path}", remedy=_REMEDY)
    rasters = tuple(_rasters(path))
    _check_datums(path, rasters)
    return Elevation(rasters=rasters, sea=sea)


def _check_datums(path: Path, rasters: tuple[Raster, ...]) -> None:
    """Raise `FormatError` if files mix heights above ellipsoid and geoid, which differ by up to
    100 m.
    """
    above = next((one for one in rasters if one.datum == ELLIPSOID), None)
    other = next((one for one in rasters if one.datum != ELLIPSOID), None)
    if above is not None and other is not None:
        raise FormatError(
            f"{path} mixes height datums: that of {Path(above.name).name} is the ellipsoid, "
            f"that of {Path(other.name).name} is {other.datum or 'unknown'}; they differ by up "
            "to 100 m",
            remedy="Keep files of one datum in a folder, or convert them to one datum: "
            "gdalwarp -s_srs EPSG:4979 -t_srs EPSG:4326+5773",
        )


def _rasters(path: Path) -> Iterator[Raster]:
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    found = 0
    for file in files:
        name = file.name.lower()
        if name.startswith(".") or not file.is_file():
            continue
        if name.endswith(srtm.SUFFIXES):
            yield srtm.srtm_raster(file)
        elif name.endswith(geotiff.SUFFIXES):
            yield geotiff.geotiff_raster(file)
        else:
            continue
        found += 1
    if not found:
        raise FormatError(f"{path} contains no ground heights", remedy=_REMEDY)
