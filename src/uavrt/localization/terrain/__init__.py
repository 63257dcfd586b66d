"""Model the ground between drone and tag: elevation files, ground heights, losses behind hills.

`elevation_files` opens SRTM tiles and GeoTIFF files, `elevation` gives heights at positions,
and `squares` on a grid in metres around a point. `diffraction` computes the loss over one
profile, `viewshed` the losses to all positions around a drone, and `hill_losses` those for a
whole flight. Only `elevation_files`, `srtm` and `geotiff_elevation` read files.
"""
