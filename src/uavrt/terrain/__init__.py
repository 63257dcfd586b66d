"""Ground between drone and tag: elevation files, ground heights, loss behind hills.

`elevation_files` opens SRTM tiles and GeoTIFF, `elevation` gives heights at places, `squares`
in metres around a point. `diffraction` is the loss over one profile, `viewshed` that to every
place around a drone, `hill_losses` those of a whole flight. Only `elevation_files`, `srtm` and
`geotiff` read files.
"""
