"""Ground between drone and tag: elevation files, ground heights, loss behind hills.

`elevation_files` opens SRTM tiles and GeoTIFF, `elevation` gives heights at positions,
`squares` on a grid in metres around a point. `diffraction` computes the loss over one profile,
`viewshed` to all positions around a drone, `hill_losses` for a whole flight. Only
`elevation_files`, `srtm` and `geotiff_elevation` read files.
"""
