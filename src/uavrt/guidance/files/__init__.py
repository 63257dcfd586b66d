"""Read areas, paths and missions of other programs, and write plans for them."""
