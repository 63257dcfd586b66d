"""The ground between drone and tag: elevation files, heights around a place, loss behind hills.

`elevation_files` opens SRTM tiles and GeoTIFF, `elevation` gives heights at places,
`squares` in metres around a point; `diffraction` is the loss over one profile, `viewshed`
that to every place around a drone, `hill_losses` those of a whole flight. `elevation_files`,
`srtm` and `geotiff` read files, nothing here does any other input or output.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.terrain.diffraction import knife_edge_db
    from uavrt.terrain.elevation import Elevation, Raster
    from uavrt.terrain.elevation_files import open_elevation
    from uavrt.terrain.hill_losses import HillLosses, LossesFrom
    from uavrt.terrain.squares import GroundGrid, ground_grid
    from uavrt.terrain.viewshed import terrain_loss_map

__all__ = [
    "Elevation",
    "GroundGrid",
    "HillLosses",
    "LossesFrom",
    "Raster",
    "ground_grid",
    "knife_edge_db",
    "open_elevation",
    "terrain_loss_map",
]
__getattr__ = lazily(
    __name__,
    {
        "Elevation": "elevation",
        "GroundGrid": "squares",
        "HillLosses": "hill_losses",
        "LossesFrom": "hill_losses",
        "Raster": "elevation",
        "ground_grid": "squares",
        "knife_edge_db": "diffraction",
        "open_elevation": "elevation_files",
        "terrain_loss_map": "viewshed",
    },
)
