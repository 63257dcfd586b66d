"""Read areas, paths and missions in other programs' formats, and write missions in them."""
